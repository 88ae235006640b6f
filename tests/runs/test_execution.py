"""Runs: finished work is not repeated, and a killed run ends with the same bytes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from baselines import floors
from dextron_bench.evaluation.replay import replay
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.methods import registry
from dextron_bench.reaches.setting import from_frame
from dextron_bench.runs import execution, result_files
from dextron_bench.runs.plans import Plan, resolve
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import atomic, hashing, tensors
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.short_reaches import SETTINGS, SOURCE
from tests.helpers.tiny_runs import execute, forbidden

PLAN = Plan("exp", "synthetic", ("val", "test"), seed=0)


def contents(folder: Path) -> dict[str, bytes]:
    """All files except recordings, because their row ids are random, and the times of the run."""
    files = (file for file in folder.rglob("*") if file.is_file() and file.suffix != ".rrd")
    return {str(file.relative_to(folder)): file.read_bytes() for file in files if file.name != "times.json"}


def test_a_second_execution_computes_nothing_and_changes_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = execute(tmp_path, PLAN)
    before, times = contents(folder), (folder / "times.json").read_bytes()
    assert set(before) == {"config.json", "provenance.json", "episodes.parquet", "result.json"}
    monkeypatch.setattr(execution, "rollout", forbidden)
    assert execute(tmp_path, PLAN) == folder == tmp_path / "exp" / "synthetic" / "seed0"
    assert contents(folder) == before
    assert (folder / "times.json").read_bytes() == times


@pytest.mark.slow
def test_a_run_killed_between_splits_ends_with_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    unbroken = contents(execute(tmp_path / "unbroken", PLAN))

    def killed(agent: object, source: object, cases: list, **options: Any) -> Any:
        if len(cases) == 2:  # Split test.
            raise KeyboardInterrupt
        return rollout(ExpertAgent(), tiny_benchmark.SOURCE, cases, **options)

    with monkeypatch.context() as patched:
        patched.setattr(execution, "rollout", killed)
        with pytest.raises(KeyboardInterrupt):
            execute(tmp_path / "broken", PLAN)
    broken = tmp_path / "broken" / "exp" / "synthetic" / "seed0"
    assert not (broken / "result.json").exists()
    assert pd.read_parquet(broken / "episodes.parquet")["split"].tolist() == ["val"]
    assert contents(execute(tmp_path / "broken", PLAN)) == unbroken


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
            execute(tmp_path, PLAN)
    assert (execute(tmp_path, PLAN) / "result.json").exists()


def test_the_result_is_computed_from_the_episodes(tmp_path: Path):
    folder = execute(tmp_path, PLAN)
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
    rows = pd.read_parquet(execute(tmp_path, PLAN) / "episodes.parquet")
    replayed = dict(replay(SOURCE, from_frame(rows), rows["actions"].tolist(), threads=1))
    assert [replayed[k].score for k in range(len(rows))] == rows["score"].tolist()
    assert [len(replayed[k].actions) for k in range(len(rows))] == rows["length"].tolist()


def test_actions_that_end_before_the_episode_fail_it():
    (_, short), (_, empty) = sorted(replay(SOURCE, [SETTINGS[0]] * 2, [np.zeros(3), np.zeros(0)], threads=1))
    assert (short.failure, empty.failure) == ("action is nan at step 3", "action is nan at step 0")


def test_a_later_execution_adds_splits(tmp_path: Path):
    execute(tmp_path, Plan("nothing", "synthetic", ("val",), 0))
    folder = execute(tmp_path, Plan("nothing", "synthetic", ("open",), 0))
    assert set(result_files.read_result(folder / "result.json")["splits"]) == {"val", "open"}


def test_a_changed_split_is_played_again(tmp_path: Path):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    folder = execute(tmp_path, plan)
    rows = tiny_benchmark.ROWS.copy()
    rows.loc[rows["split"] == "open", "offset_x"] = 0.03
    tiny_benchmark.write(tmp_path / "data", rows)
    tiny_benchmark.forget()
    execute(tmp_path, plan)
    episodes = pd.read_parquet(folder / "episodes.parquet")
    assert episodes["offset_x"].tolist() == [0.03]
    assert (
        result_files.read_result(folder / "result.json")["splits"]["open"]["digest"]
        == load_split("synthetic", "open").digest
    )


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


def test_weights_are_hashed_and_splits_are_loaded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    tiny_training.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    plan = Plan("tests.helpers.toy_learner:Toy", "synthetic", ("test",), settings={"preset": "quick"})
    hashed, sha256, loaded, load = [], hashing.sha256, [], execution.load_split
    monkeypatch.setattr(hashing, "sha256", lambda file: hashed.append(Path(file).name) or sha256(file))
    monkeypatch.setattr(execution, "load_split", lambda *names: loaded.append(names[1]) or load(*names))
    execution.execute(resolve(plan), tmp_path / "runs", threads=1)
    assert hashed.count("weights.safetensors") == 1
    assert loaded.count("test") == 1


def test_a_run_constructs_its_method_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    constructed, construct = [], floors.Nothing.__init__
    monkeypatch.setattr(floors.Nothing, "__init__", lambda self: constructed.append(self) or construct(self))
    execution.execute(resolve(Plan("nothing", "synthetic", ("test", "open"), record=1)), tmp_path, threads=1)
    assert len(constructed) == 1


def test_a_run_reads_its_splits_and_its_weights_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The weights are hashed once, read once into an agent, and each split is loaded once for the evaluation."""
    tiny_training.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    run = resolve(Plan(tiny_training.TOY, "synthetic", ("test", "open"), settings={"preset": "smoke"}))
    execution.train([run], tmp_path / "runs", threads=1)
    hashed, loaded, read = [], [], []
    hash_file, load, read_arrays = hashing.sha256, execution.load_split, tensors.read
    monkeypatch.setattr(hashing, "sha256", lambda file: hashed.append(file.name) or hash_file(file))
    monkeypatch.setattr(execution, "load_split", lambda *names: loaded.append(names[1]) or load(*names))
    monkeypatch.setattr(tensors, "read", lambda file: read.append(file.name) or read_arrays(file))
    execution.execute(run, tmp_path / "runs", threads=1)
    assert hashed.count("weights.safetensors") == read.count("weights.safetensors") == 1
    assert sorted(loaded) == ["open", "test", "train"]  # `train` for the number of demonstrations.
