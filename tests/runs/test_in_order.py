"""Scores in a random order: played until they are needed, kept, and taken from finished runs where there are some."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench.methods import weights
from dextron_bench.runs import contenders, in_order, result_files
from dextron_bench.runs.contenders import open_scores
from dextron_bench.runs.in_order import PlayedScores, StoredScores
from dextron_bench.runs.plans import Plan
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.splits.order import random_order
from dextron_bench.storage import provenance
from tests.helpers import tiny_benchmark
from tests.helpers.tiny_runs import constant_agent, execute, forbidden

ROWS = 12  # Of the split: the even ones are solved by their expert, and at the odd ones the bottle falls.


@pytest.fixture
def split(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Split:
    """A split of twelve rows; four episodes are played at once."""
    cases = [tiny_benchmark.FALLS if row % 2 else tiny_benchmark.SOLVED[0] for row in range(ROWS)]
    rows = pd.DataFrame([("test", *case) for case in cases], columns=tiny_benchmark.COLUMNS)
    tiny_benchmark.write(tmp_path / "data", rows)
    tiny_benchmark.forget()
    monkeypatch.setattr(in_order, "SLOTS", 4)
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "abc", "physics": physics})
    monkeypatch.setattr(result_files, "published_results", lambda: tmp_path / "published")
    return load_split("synthetic", "test")


def expected(split: Split, count: int) -> list[float]:
    return [0.0 if row % 2 else 20.0 for row in random_order(split)[:count]]


def test_only_the_rows_that_are_needed_are_played(split: Split, tmp_path: Path):
    """Failures end earlier than successes, but scores come in the random order."""
    scores = open_scores("exp", split, tmp_path / "runs", threads=1)
    assert isinstance(scores, PlayedScores)
    assert (scores.name, scores.seeds, scores.begun, scores.is_stored) == ("exp", 1, 0, False)
    assert scores.first(3).tolist() == [expected(split, 3)]
    assert 3 + 4 <= scores.begun < ROWS
    assert scores.failed == 0


def test_the_same_command_continues_and_plays_no_row_twice(
    split: Split, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    first = open_scores("exp", split, tmp_path / "runs", threads=1)
    first.first(4)
    first.close()
    again = open_scores("exp", split, tmp_path / "runs", threads=1)
    assert again.begun >= 4
    assert again.first(ROWS).tolist() == [expected(split, ROWS)]
    again.close()
    monkeypatch.setattr(in_order.episode_table, "row", forbidden)
    last = open_scores("exp", split, tmp_path / "runs", threads=1)
    assert last.first(ROWS).tolist() == [expected(split, ROWS)]
    assert last.begun == ROWS


def test_finished_runs_are_not_played_again(split: Split, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    runs = tmp_path / "runs"
    execute(runs, Plan("exp", "synthetic", ("test",)))
    monkeypatch.setattr(in_order, "rollout", forbidden)
    scores = open_scores("exp", split, runs)
    assert isinstance(scores, StoredScores)
    assert scores.first(5).tolist() == [expected(split, 5)]
    assert (scores.seeds, scores.begun) == (1, 0)


def test_a_result_of_other_physics_is_played_again(split: Split, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    execute(tmp_path / "runs", Plan("exp", "synthetic", ("test",)))
    monkeypatch.setattr(contenders.provenance, "physics_of", lambda result: "old")
    assert isinstance(open_scores("exp", split, tmp_path / "runs"), PlayedScores)


def test_each_seed_of_an_agent_plays(split: Split, tmp_path: Path):
    scores = open_scores("random", split, tmp_path / "runs", seeds=(0, 1), threads=1)
    assert scores.first(2).shape == (2, 2)
    scores.close()
    folder = tmp_path / "runs/sequential/random/synthetic"
    assert sorted(place.name for place in folder.iterdir()) == ["seed0", "seed1"]


def test_a_changed_agent_begins_again_beside_its_older_version(split: Split, tmp_path: Path, unload: Callable[[], Any]):
    runs = tmp_path / "runs"
    older = open_scores(constant_agent(tmp_path, "0.0"), split, runs, threads=1)
    older.first(2)
    older.close()
    unload()
    newer = open_scores(constant_agent(tmp_path, "-0.5"), split, runs, threads=1)
    assert newer.begun == 0
    assert newer.name.startswith("constant+")


@pytest.fixture
def unload(monkeypatch: pytest.MonkeyPatch) -> Callable[[], Any]:
    """Forgets the modules of agents in files, so that they are read again."""
    import sys

    from dextron_bench.methods.loading import PREFIX

    def forget() -> None:
        for name in [name for name in sys.modules if name.startswith(PREFIX)]:
            monkeypatch.delitem(sys.modules, name)

    return forget


def test_the_episodes_that_an_agent_fails_are_counted(split: Split, tmp_path: Path):
    scores = open_scores(constant_agent(tmp_path, "np.nan"), split, tmp_path / "runs", threads=1)
    assert scores.first(3).tolist() == [[0.0, 0.0, 0.0]]
    assert scores.failed >= 3


def test_weights_that_do_not_ship_are_named(split: Split, tmp_path: Path):
    with pytest.raises(weights.MissingWeights, match="no weights of 'rl' on synthetic reaches ship for seed 77"):
        open_scores("rl", split, tmp_path / "runs", seeds=(77,))


def test_a_method_of_another_source_is_refused(split: Split, tmp_path: Path):
    with pytest.raises(contenders.OtherSource, match=r"always evaluated on minjerk reaches, not on synth"):
        open_scores("sim", split, tmp_path / "runs")


def test_stored_scores_are_in_the_random_order(split: Split):
    scores = StoredScores("x", np.arange(2.0 * ROWS).reshape(2, ROWS), split)
    order = np.array(random_order(split))
    assert scores.first(ROWS).tolist() == [order.tolist(), (ROWS + order).tolist()]
