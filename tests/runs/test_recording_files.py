"""Recordings of a run: they read back as the episode, and an episode without a step has none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench import recording
from dextron_bench.evaluation import diagnosis
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.runs import execution, result_files
from dextron_bench.runs.plans import Plan
from dextron_bench.splits.loading import load_split
from tests.helpers import tiny_benchmark
from tests.helpers.tiny_runs import constant_agent, execute, forbidden


def test_a_recording_reads_back_as_the_episode(tmp_path: Path):
    folder = execute(tmp_path, Plan("exp", "synthetic", ("test",), seed=3, record=1))
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


def test_an_episode_that_is_recorded_is_diagnosed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    diagnosed, diagnose = list[object](), diagnosis.diagnose
    monkeypatch.setattr(diagnosis, "diagnose", lambda *one: diagnosed.append(one) or diagnose(*one))
    folder = execute(tmp_path, Plan("exp", "synthetic", ("test",), seed=3, record=1))
    table = pd.read_parquet(folder / "episodes.parquet")
    assert len(diagnosed) == len(table)
    recorded = recording.read(folder / "recordings" / "test-0000.rrd")
    assert recorded.properties["cause"] == table["cause"].iloc[0]


def test_an_episode_without_a_step_is_not_recorded_and_not_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(recording, "write", forbidden)
    spec = constant_agent(tmp_path, "np.nan")
    plan = Plan(spec, "synthetic", ("open",), seed=0, record=1)
    folder = execute(tmp_path, plan)
    assert result_files.read_result(folder / "result.json")["splits"]["open"] == {
        "digest": load_split("synthetic", "open").digest, "scores": [0.0], "failed": 1,
        "causes": {"agent failed": 1}, "closing_lag": None, "actions": ["af5570f5a181"],
    }  # fmt: skip
    monkeypatch.setattr(execution, "rollout", forbidden)
    execute(tmp_path, plan)
