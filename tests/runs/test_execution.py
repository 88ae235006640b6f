"""Runs: finished work is not repeated, a killed run ends with the same bytes, and damaged files are named."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from baselines import floors
from dextron_bench import recording
from dextron_bench.evaluation.replay import replay
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.methods import registry
from dextron_bench.reaches.setting import from_frame
from dextron_bench.runs import execution, result_files
from dextron_bench.runs.plans import Plan, resolve
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import atomic, provenance
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.folder_config import FolderMismatch
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.short_reaches import SETTINGS, SOURCE

PLAN = Plan("exp", "synthetic", ("val", "test"), seed=0)
AGENT = """
import numpy as np

class Mine:
    name = "mine"
    value = {value}
    def agent(self, seed): return self
    def reset(self, episodes): ...
    def act(self, states): return np.full((len(states), 1), self.value)
"""


@pytest.fixture(autouse=True)
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Tiny splits of short reaches, and a provenance that does not depend on the commit."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "abc"})
    yield
    tiny_benchmark.forget()


def play(folder: Path, plan: Plan = PLAN) -> Path:
    return execution.execute(resolve(plan), folder, threads=1)


def contents(folder: Path) -> dict[str, bytes]:
    """All files except recordings, because their row ids are random."""
    files = (file for file in folder.rglob("*") if file.is_file() and file.suffix != ".rrd")
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def agent(tmp_path: Path, value: str) -> str:
    file = tmp_path / "mine.py"
    file.write_text(AGENT.format(value=value))
    return f"{file}:Mine"


def forbid(*_: object, **__: object) -> Any:
    raise AssertionError("repeated finished work")


def test_a_second_execution_computes_nothing_and_changes_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = play(tmp_path)
    before = contents(folder)
    assert set(before) == {"config.json", "provenance.json", "episodes.parquet", "result.json"}
    monkeypatch.setattr(execution, "rollout", forbid)
    assert play(tmp_path) == folder == tmp_path / "exp" / "synthetic" / "seed0"
    assert contents(folder) == before


def test_a_run_killed_between_splits_ends_with_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    unbroken = contents(play(tmp_path / "unbroken"))

    def killed(agent: object, source: object, cases: list, **options: Any) -> Any:
        if len(cases) == 2:  # Split test.
            raise KeyboardInterrupt
        return rollout(ExpertAgent(), tiny_benchmark.SOURCE, cases, **options)

    with monkeypatch.context() as patched:
        patched.setattr(execution, "rollout", killed)
        with pytest.raises(KeyboardInterrupt):
            play(tmp_path / "broken")
    broken = tmp_path / "broken" / "exp" / "synthetic" / "seed0"
    assert not (broken / "result.json").exists()
    assert pd.read_parquet(broken / "episodes.parquet")["split"].tolist() == ["val"]
    assert contents(play(tmp_path / "broken")) == unbroken


def test_a_run_killed_between_its_first_two_files_still_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Config and provenance are separate files; a run that has only one of them continues."""
    written = []

    def write_once(file: Path, value: object) -> None:
        if written:
            raise KeyboardInterrupt
        written.append(file)
        write_json(file, value)

    write_json = atomic.write_json
    with monkeypatch.context() as patched:
        patched.setattr(atomic, "write_json", write_once)
        with pytest.raises(KeyboardInterrupt):
            play(tmp_path)
    assert (play(tmp_path) / "result.json").exists()


def test_the_result_is_computed_from_the_episodes(tmp_path: Path):
    folder = play(tmp_path)
    episodes, result = pd.read_parquet(folder / "episodes.parquet"), result_files.read_result(folder / "result.json")
    assert (result["method"], result["reaches"], result["seed"]) == ("exp", "synthetic", 0)
    assert set(result["splits"]) == {"val", "test"}
    for name, split in result["splits"].items():
        rows = episodes[episodes["split"] == name]
        assert rows["row"].tolist() == list(range(len(rows)))
        assert split["scores"] == rows["score"].tolist() == [20.0] * len(rows)
        assert set(rows["cause"]) == {"solved"}
        assert rows["closing_lag"].between(0.0, 0.12).all()
        assert split["digest"] == load_split("synthetic", name).digest
        assert split["failed"] == 0
    assert episodes["success"].all()


def test_the_stored_actions_reproduce_every_episode(tmp_path: Path):
    rows = pd.read_parquet(play(tmp_path) / "episodes.parquet")
    replayed = dict(replay(SOURCE, from_frame(rows), rows["actions"].tolist(), threads=1))
    assert [replayed[k].score for k in range(len(rows))] == rows["score"].tolist()
    assert [len(replayed[k].actions) for k in range(len(rows))] == rows["length"].tolist()


def test_actions_that_end_before_the_episode_fail_it():
    (_, short), (_, empty) = sorted(replay(SOURCE, [SETTINGS[0]] * 2, [np.zeros(3), np.zeros(0)], threads=1))
    assert (short.failure, empty.failure) == ("action is nan at step 3", "action is nan at step 0")


def test_a_recording_reads_back_as_the_episode(tmp_path: Path):
    folder = play(tmp_path, Plan("exp", "synthetic", ("test",), seed=3, record=1))
    assert [file.name for file in (folder / "recordings").iterdir()] == ["test-0000.rrd"]
    manifest = json.loads((folder / "recordings.json").read_text())
    recorded = recording.read(folder / "recordings" / "test-0000.rrd", sha256=manifest["test-0000.rrd"])
    split = load_split("synthetic", "test")
    _, episode = next(iter(rollout(ExpertAgent(), tiny_benchmark.SOURCE, split.cases[:1], threads=1)))
    assert recorded.episode.setting == split.cases[0].setting
    for name in ("states", "actions", "rewards"):
        np.testing.assert_array_equal(getattr(recorded.episode, name), getattr(episode, name))
    properties = {
        name: recorded.properties[name] for name in ("method", "reaches", "split", "split_digest", "row", "seed")
    }
    assert properties == {
        "method": "exp", "reaches": "synthetic", "split": "test", "split_digest": split.digest, "row": 0, "seed": 3,
    }  # fmt: skip


def test_an_episode_without_a_step_is_not_recorded_and_not_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(recording, "write", forbid)
    spec = agent(tmp_path, "np.nan")
    plan = Plan(spec, "synthetic", ("open",), seed=0, record=1)
    folder = play(tmp_path, plan)
    assert result_files.read_result(folder / "result.json")["splits"]["open"] == {
        "digest": load_split("synthetic", "open").digest, "scores": [0.0], "failed": 1,
        "causes": {"agent failed": 1}, "closing_lag": None, "actions": ["af5570f5a181"],
    }  # fmt: skip
    monkeypatch.setattr(execution, "rollout", forbid)
    play(tmp_path, plan)


def test_a_later_execution_adds_splits(tmp_path: Path):
    play(tmp_path, Plan("nothing", "synthetic", ("val",), 0))
    folder = play(tmp_path, Plan("nothing", "synthetic", ("open",), 0))
    assert set(result_files.read_result(folder / "result.json")["splits"]) == {"val", "open"}


def test_a_changed_split_is_played_again(tmp_path: Path):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    folder = play(tmp_path, plan)
    rows = tiny_benchmark.ROWS.copy()
    rows.loc[rows["split"] == "open", "offset_x"] = 0.03
    tiny_benchmark.write(tmp_path / "data", rows)
    tiny_benchmark.forget()
    play(tmp_path, plan)
    episodes = pd.read_parquet(folder / "episodes.parquet")
    assert episodes["offset_x"].tolist() == [0.03]
    assert (
        result_files.read_result(folder / "result.json")["splits"]["open"]["digest"]
        == load_split("synthetic", "open").digest
    )


def test_changed_code_in_the_same_folder_is_a_mismatch(tmp_path: Path):
    spec = agent(tmp_path, "0.0")
    plan = Plan(spec, "synthetic", ("open",), 0)
    play(tmp_path, plan)
    agent(tmp_path, "0.5")
    with pytest.raises(
        FolderMismatch,
        match=r"seed0 holds another run: it differs in code \(sha256\); remove it, or choose",
    ):
        play(tmp_path, plan)


def test_another_method_of_the_same_name_is_a_mismatch(tmp_path: Path):
    play(tmp_path, Plan("nothing", "synthetic", ("open",), 0))
    file = tmp_path / "other.py"
    file.write_text(AGENT.format(value=0.0).replace('"mine"', '"nothing"'))
    with pytest.raises(FolderMismatch, match="differs in code"):
        play(tmp_path, Plan(f"{file}:Mine", "synthetic", ("open",), 0))


def test_other_physics_in_the_same_folder_is_a_mismatch(tmp_path: Path):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    config = play(tmp_path, plan) / "config.json"
    config.write_text(json.dumps(json.loads(config.read_text()) | {"physics": "other"}))
    with pytest.raises(FolderMismatch, match="differs in physics"):
        play(tmp_path, plan)


@pytest.mark.parametrize("name", ["episodes.parquet", "config.json", "provenance.json"])
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, name: str):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    file = play(tmp_path, plan) / name
    file.write_bytes(file.read_bytes()[:10])
    with pytest.raises(DamagedFile) as caught:
        play(tmp_path, plan)
    assert str(caught.value).startswith(f"{file} is damaged (")
    assert str(caught.value).endswith("; remove it and run again")


def test_progress_counts_the_episodes_of_each_split(tmp_path: Path):
    reports = []
    run = resolve(Plan("nothing", "synthetic", ("test", "open"), 0))
    execution.execute(run, tmp_path, 1, lambda done, total, note="": reports.append((done, total)))
    assert reports == [(1, 2), (2, 2), (1, 1)]
    assert not [file for file in os.listdir(tmp_path / "nothing" / "synthetic" / "seed0") if file.endswith(".part")]


@pytest.mark.parametrize(
    ("spec", "settings"),
    [("tests.helpers.toy_learner:Toy", {"preset": "quick"}), ("tests.helpers.toy_learner:ToyTransfer", {})],
)
def test_a_run_creates_its_method_once(
    spec: str, settings: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """`resolve` creates the method; training, evaluation and the result use this object."""
    tiny_training.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    created, create = [], registry.create
    monkeypatch.setattr(registry, "create", lambda *args: created.append(args[0]) or create(*args))
    execution.execute(resolve(Plan(spec, "synthetic", ("test",), settings=settings)), tmp_path / "runs", threads=1)
    assert created == [spec]


def test_a_run_constructs_its_method_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    constructed, construct = [], floors.Nothing.__init__
    monkeypatch.setattr(floors.Nothing, "__init__", lambda self: constructed.append(self) or construct(self))
    execution.execute(resolve(Plan("nothing", "synthetic", ("test", "open"), record=1)), tmp_path, threads=1)
    assert len(constructed) == 1
