"""The catalogue of episodes: one row each, with the words of the command line, and the way back to the run."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.catalogue import episodes
from dextron_bench.storage import tables


@pytest.fixture
def runs(two_runs: Path) -> Path:
    """A run of two solved episodes."""
    shutil.rmtree(two_runs / "runs/nothing")
    return two_runs / "runs"


def test_rows_have_the_words_of_the_command_line(runs: Path):
    table = episodes.read([runs, runs])
    assert list(table) == [*episodes.COLUMNS, "digest", episodes.STATE]
    first = table.iloc[0]
    known = ("method", "reaches", "seed", "split", "row", "return", "cause", "subject", "ring", "angle", "reach")
    assert [first[name] for name in known] == ["exp", "synthetic", 0, "test", 0, 20.0, "solved", "made-up", 0, 3, "a"]
    assert table.index.is_unique
    assert len(table) == 2
    state = episodes.last_state(first)
    assert state is not None
    assert state[2] > 0.25  # [m] the bottle is up.


def test_an_episode_is_found_again_with_its_actions(runs: Path):
    (row,) = episodes.with_actions(episodes.read([runs]).iloc[[1]]).to_dict("records")
    assert (row["row"], row["method"], len(row["actions"])) == (1, "exp", row["steps"])
    assert Path(row["run"]) == runs / "exp/synthetic/seed0"


def test_a_run_that_has_changed_is_refused(runs: Path):
    changed = episodes.read([runs]).iloc[[0]].copy()
    changed["return"] = 3.0
    with pytest.raises(episodes.NoEpisodes, match="has changed since its episodes were read"):
        episodes.with_actions(changed)


@pytest.mark.parametrize("state", [None, "x", [0.0] * 47, [np.nan] * 48, [[1.0] * 48]])
def test_what_is_no_state_is_not_drawn(state: object):
    assert episodes.last_state(pd.Series({episodes.STATE: state})) is None


def test_a_table_of_an_earlier_version_has_no_states(runs: Path):
    file = runs / "exp/synthetic/seed0/episodes.parquet"
    stored = pd.read_parquet(file).drop(columns=episodes.STATE)
    stored.attrs = {}
    tables.write(file, stored)
    assert episodes.last_state(episodes.read([runs]).iloc[0]) is None
