"""Schemas: wrong values are named with their place, and every JSON file is read through a schema."""

from __future__ import annotations

import ast
import json
import math
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.storage import schemas, tensors
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.world import task

ROOT = Path(__file__).parents[2]
SPLIT: dict[str, Any] = {"digest": "d", "scores": [20, 0.0], "failed": 0, "causes": {"slipped": 1}, "closing_lag": None}
RESULT: dict[str, Any] = {"method": "a", "reaches": "real", "seed": 0, "splits": {"test": SPLIT}}


def damage(file: Path, content: Any, schema: schemas.Schema) -> str:
    """The message for a file with this content."""
    file.write_text(json.dumps(content))
    with pytest.raises(DamagedFile) as caught:
        schemas.read(file, schema)
    return str(caught.value)


def test_the_full_return_is_the_task_s():
    assert schemas.FULL_RETURN == task.SUCCESS


def test_a_result_of_the_known_form_is_read_unchanged(tmp_path: Path):
    (tmp_path / "result.json").write_text(json.dumps(RESULT | {"new": 1}))
    assert schemas.read(tmp_path / "result.json", schemas.RESULT) == RESULT | {"new": 1}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": None}, "method is not text"),
        ({"seed": True}, "seed is not a whole number"),
        ({"seed": 10**30}, "seed is not a whole number"),
        ({"splits": {}}, "splits is not an object with 1 or more entries"),
        ({"splits": {"test": SPLIT | {"closing_lag": "soon"}}}, "splits/test/closing_lag is not a finite number"),
        ({"splits": {"test": SPLIT | {"scores": [20.0, 1e308]}}}, "splits/test/scores/1 is not a number from 0 to 20"),
        ({"splits": {"test": SPLIT | {"scores": [-5]}}}, "splits/test/scores/0 is not a number from 0 to 20"),
        ({"splits": {"test": SPLIT | {"scores": []}}}, "splits/test/scores is not a list of 1 or more values"),
        ({"splits": {"test": SPLIT | {"scores": [math.nan]}}}, "NaN is no JSON number"),
        ({"splits": {"test": SPLIT | {"scores": [10**400]}}}, "splits/test/scores/0 is not a number from 0 to 20"),
        ({"training": {"frames": "many"}}, "training/frames is not a number"),
    ],
)
def test_a_wrong_value_is_named_with_its_place(tmp_path: Path, change: dict[str, Any], message: str):
    text = damage(tmp_path / "result.json", RESULT | change, schemas.RESULT)
    is_proof = "NaN" in message
    assert text.startswith(f"{tmp_path}/result.json is damaged {'' if is_proof else 'or of another version '}(")
    assert message in text
    assert ("remove" in text) == is_proof


@pytest.mark.parametrize("content", [None, "text", [], {}, {"points": None}, {"points": [{"epoch": 1}]}])
def test_a_curve_without_points_is_damaged(tmp_path: Path, content: Any):
    assert "curve.json is damaged" in damage(tmp_path / "curve.json", content, schemas.CURVE)


def test_a_number_that_overflows_is_not_finite(tmp_path: Path):
    (tmp_path / "a.json").write_text('{"points": [{"epoch": 1, "return": 1e999, "success": 0.0}]}')
    with pytest.raises(DamagedFile, match="points/0/return is not a number from 0 to 20"):
        schemas.read(tmp_path / "a.json", schemas.CURVE)


def test_lines_that_are_cut_or_not_text_are_none():
    lines = b'{"what": "epoch", "seconds": 2.0}\n\xff\xfe\n[]\n{"what": "epoch", "seconds": "2"}\n{"what": "ep'
    assert list(schemas.rows(lines, schemas.DURATION)) == [{"what": "epoch", "seconds": 2.0}, None, None, None, None]


def test_metadata_of_tensors_has_a_schema(tmp_path: Path):
    tensors.write(tmp_path / "a.safetensors", {}, {"epoch": "3"})
    with pytest.raises(tensors.BadTensors, match=r"a\.safetensors .*epoch is not a whole number"):
        schemas.read_about(tmp_path / "a.safetensors", schemas.SNAPSHOT)


def test_every_json_file_of_a_run_is_read_through_a_schema():
    """Bundles have their own reader, since they come from strangers."""
    readers = [
        file.relative_to(ROOT).as_posix()
        for folder in ("dextron_bench", "baselines")
        for file in sorted((ROOT / folder).rglob("*.py"))
        if any(isinstance(node, ast.Attribute) and node.attr == "read_json" for node in ast.walk(_tree(file)))
    ]
    assert set(readers) <= {"dextron_bench/storage/schemas.py", "dextron_bench/submissions/seed_check.py"}


def _tree(file: Path) -> ast.AST:
    return ast.parse(file.read_text(encoding="utf-8"))
