"""Runs: what is done is not done again, a killed run ends as an unbroken one, and damage is told."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench import recording
from dextron_bench.evaluation.replay import replay
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches.setting import from_frame
from dextron_bench.runs import execution, result_files
from dextron_bench.runs.plans import Plan, resolve
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import atomic, provenance
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.folder_config import FolderMismatch
from tests.helpers import tiny_benchmark
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
    """Tiny splits of short reaches; and a provenance that no one's commit changes meanwhile."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "abc"})
    yield
    tiny_benchmark.forget()


def play(folder: Path, plan: Plan = PLAN) -> Path:
    return execution.execute(resolve(plan), folder, threads=1)


def contents(folder: Path) -> dict[str, bytes]:
    """All files but recordings, whose row ids are random."""
    files = (file for file in folder.rglob("*") if file.is_file() and file.suffix != ".rrd")
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def agent(tmp_path: Path, value: str) -> str:
    file = tmp_path / "mine.py"
    file.write_text(AGENT.format(value=value))
    return f"{file}:Mine"


def forbid(*_: object, **__: object) -> Any:
    raise AssertionError("this was already done")


def test_a_run_again_computes_nothing_and_changes_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = play(tmp_path)
    before = contents(folder)
    assert set(before) == {"config.json", "provenance.json", "episodes.parquet", "result.json"}
    monkeypatch.setattr(execution, "rollout", forbid)
    assert play(tmp_path) == folder == tmp_path / "exp" / "synthetic" / "seed0"
    assert contents(folder) == before


def test_killed_between_splits_it_ends_with_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    whole = contents(play(tmp_path / "whole"))

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
    assert contents(play(tmp_path / "broken")) == whole


def test_killed_between_its_first_two_files_it_still_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Whichever of config and provenance is written first, a run that has one of them goes on."""
    written = []

    def once(file: Path, value: object) -> None:
        if written:
            raise KeyboardInterrupt
        written.append(file)
        write_json(file, value)

    write_json = atomic.write_json
    with monkeypatch.context() as patched:
        patched.setattr(atomic, "write_json", once)
        with pytest.raises(KeyboardInterrupt):
            play(tmp_path)
    assert (play(tmp_path) / "result.json").exists()


def test_the_result_is_what_the_episodes_say(tmp_path: Path):
    folder = play(tmp_path)
    episodes, result = pd.read_parquet(folder / "episodes.parquet"), result_files.read_result(folder / "result.json")
    assert (result["method"], result["reaches"], result["seed"]) == ("exp", "synthetic", 0)
    assert set(result["splits"]) == {"val", "test"}
    for name, found in result["splits"].items():
        rows = episodes[episodes["split"] == name]
        assert rows["row"].tolist() == list(range(len(rows)))
        assert found["scores"] == rows["score"].tolist() == [20.0] * len(rows)
        assert set(rows["cause"]) == {"solved"}
        assert rows["closing_lag"].between(0.0, 0.12).all()
        assert found["digest"] == load_split("synthetic", name).digest
        assert found["failed"] == 0
    assert episodes["success"].all()


def test_its_actions_play_every_episode_again(tmp_path: Path):
    rows = pd.read_parquet(play(tmp_path) / "episodes.parquet")
    again = dict(replay(SOURCE, from_frame(rows), rows["actions"].tolist(), threads=1))
    assert [again[k].score for k in range(len(rows))] == rows["score"].tolist()
    assert [len(again[k].actions) for k in range(len(rows))] == rows["length"].tolist()


def test_actions_that_end_before_the_episode_fail_it():
    (_, found), (_, empty) = sorted(replay(SOURCE, [SETTINGS[0]] * 2, [np.zeros(3), np.zeros(0)], threads=1))
    assert (found.failure, empty.failure) == ("action is nan at step 3", "action is nan at step 0")


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
    told = {name: recorded.properties[name] for name in ("method", "reaches", "split", "split_digest", "row", "seed")}
    assert told == {
        "method": "exp", "reaches": "synthetic", "split": "test", "split_digest": split.digest, "row": 0, "seed": 3,
    }  # fmt: skip


def test_a_missing_recording_is_made_and_one_that_cannot_be_is_not_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    made = []
    monkeypatch.setattr(recording, "write", lambda file, *_: (file.parent.mkdir(exist_ok=True), made.append(file.name)))
    spec = agent(tmp_path, "np.nan")
    plan = Plan(spec, "synthetic", ("open",), seed=0, record=1)
    folder = play(tmp_path, plan)
    assert made == []  # An episode that failed before its first step.
    assert result_files.read_result(folder / "result.json")["splits"]["open"] == {
        "digest": load_split("synthetic", "open").digest, "scores": [0.0], "failed": 1,
        "causes": {"agent failed": 1}, "closing_lag": None, "actions": ["af5570f5a181"],
    }  # fmt: skip
    monkeypatch.setattr(execution, "rollout", forbid)
    play(tmp_path, plan)
    monkeypatch.undo()


def test_splits_are_added_to_a_run(tmp_path: Path):
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


def test_other_code_in_the_same_folder_is_a_mismatch(tmp_path: Path):
    spec = agent(tmp_path, "0.0")
    plan = Plan(spec, "synthetic", ("open",), 0)
    play(tmp_path, plan)
    agent(tmp_path, "0.5")
    with pytest.raises(
        FolderMismatch,
        match=r"seed0 holds another run: it differs in code \(sha256\); remove it, or choose",
    ):
        play(tmp_path, plan)


def test_a_name_that_another_method_has_is_a_mismatch(tmp_path: Path):
    play(tmp_path, Plan("nothing", "synthetic", ("open",), 0))
    thief = tmp_path / "thief.py"
    thief.write_text(AGENT.format(value=0.0).replace('"mine"', '"nothing"'))
    with pytest.raises(FolderMismatch, match="differs in code"):
        play(tmp_path, Plan(f"{thief}:Mine", "synthetic", ("open",), 0))


def test_other_physics_in_the_same_folder_is_a_mismatch(tmp_path: Path):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    config = play(tmp_path, plan) / "config.json"
    config.write_text(json.dumps(json.loads(config.read_text()) | {"physics": "other"}))
    with pytest.raises(FolderMismatch, match="differs in physics"):
        play(tmp_path, plan)


@pytest.mark.parametrize("file", ["episodes.parquet", "config.json", "provenance.json"])
def test_a_damaged_file_is_named_with_what_to_do(tmp_path: Path, file: str):
    plan = Plan("nothing", "synthetic", ("open",), 0)
    place = play(tmp_path, plan) / file
    place.write_bytes(place.read_bytes()[:10])
    with pytest.raises(DamagedFile) as caught:
        play(tmp_path, plan)
    assert str(caught.value).startswith(f"{place} is damaged (")
    assert str(caught.value).endswith("; remove it and run again")


RESULT = {
    "method": "a",
    "reaches": "real",
    "seed": 0,
    "splits": {"test": {"digest": "d", "scores": [1.0], "failed": 0, "causes": {"slipped": 1}, "closing_lag": 0.04}},
}


NO_RESULTS = [{}, [], RESULT | {"splits": []}, RESULT | {"splits": {"test": {}}}]
NO_RESULTS.append(
    RESULT
    | {"splits": {"test": {"digest": "d", "scores": ["a"], "failed": 0, "causes": {"slipped": 1}, "closing_lag": 0.04}}}
)


@pytest.mark.parametrize("text", ["", "{", *map(json.dumps, NO_RESULTS)])
def test_a_damaged_result_is_named(tmp_path: Path, text: str):
    place = tmp_path / "a" / "real" / "seed0" / "result.json"
    place.parent.mkdir(parents=True)
    place.write_text(json.dumps(RESULT))
    assert list(result_files.results(tmp_path)) == [RESULT]
    place.write_text(text)
    with pytest.raises(DamagedFile, match=r"result\.json is damaged"):
        list(result_files.results(tmp_path))


def test_progress_is_told_in_order(tmp_path: Path):
    told = []
    execution.execute(
        resolve(Plan("nothing", "synthetic", ("test", "open"), 0)),
        tmp_path,
        1,
        lambda done, total, note="": told.append((done, total)),
    )
    assert told == [(1, 2), (2, 2), (1, 1)]
    assert not [file for file in os.listdir(tmp_path / "nothing" / "synthetic" / "seed0") if file.endswith(".part")]
