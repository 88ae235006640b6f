"""The folder of a run belongs to one config; damaged files are named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dextron_bench.errors import BadInput
from dextron_bench.runs.plans import Plan
from dextron_bench.storage.atomic import DamagedFile
from tests.helpers.tiny_runs import constant_agent, execute


def test_changed_code_in_the_same_folder_is_a_mismatch(tmp_path: Path):
    spec = constant_agent(tmp_path, "0.0")
    plan = Plan(spec, "synthetic", ("open",), 0)
    execute(tmp_path, plan)
    constant_agent(tmp_path, "0.5")
    with pytest.raises(
        BadInput,
        match=r"seed0 holds another run: it differs in code \(sha256\); remove it, or choose",
    ):
        execute(tmp_path, plan)


def test_another_method_of_the_same_name_is_a_mismatch(tmp_path: Path):
    execute(tmp_path, Plan("nothing", "synthetic", ("open",), 0))
    spec = constant_agent(tmp_path, "0.0", name="nothing")
    with pytest.raises(BadInput, match="differs in code"):
        execute(tmp_path, Plan(spec, "synthetic", ("open",), 0))


def test_other_physics_in_the_same_folder_is_a_mismatch(tmp_path: Path):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    config = execute(tmp_path, plan) / "config.json"
    config.write_text(json.dumps(json.loads(config.read_text()) | {"physics": "other"}))
    with pytest.raises(BadInput, match="differs in physics"):
        execute(tmp_path, plan)


@pytest.mark.parametrize("name", ["episodes.parquet", "config.json", "provenance.json"])
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, name: str):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    file = execute(tmp_path, plan) / name
    file.write_bytes(file.read_bytes()[:10])
    with pytest.raises(DamagedFile) as caught:
        execute(tmp_path, plan)
    assert str(caught.value).startswith(f"{file} is damaged (")
    assert str(caught.value).endswith("; remove it and run again")
