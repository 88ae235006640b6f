"""Filters select the right episodes in the right order, and name the valid values if a value is unknown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dextron_bench.catalogue import selection
from dextron_bench.catalogue.episodes import NoEpisodes
from dextron_bench.catalogue.selection import BadFilter, EpisodeFilter

COLUMNS = ["method", "reaches", "seed", "split", "row", "return", "steps", "cause"]
TABLE = pd.DataFrame(
    [
        ("bc", "real", 0, "test", 0, 20.0, 90, "solved"),
        ("bc", "real", 0, "test", 1, 3.0, 90, "slipped"),
        ("bc", "real", 0, "test", 2, 0.0, 90, "too late"),
        ("bc", "real", 1, "val", 0, 0.0, 90, "too early"),
        ("rl", "real", 0, "test", 0, 3.0, 90, "too late"),
        ("rl", "real", 0, "test", 1, 0.0, 0, "agent failed"),
        ("rl", "synthetic", 0, "test", 0, 20.0, 90, "solved"),
    ],
    columns=COLUMNS,
).assign(success=lambda table: table["return"] == 20.0)


@pytest.mark.parametrize(
    ("settings", "rows", "passing"),
    [
        ({}, [0, 1, 2, 3, 4], 6),  # An episode without a step cannot be viewed.
        ({"worst": 3}, [2, 3, 1], 6),  # Equal returns in the order of the tables.
        ({"best": 3}, [0, 6, 1], 6),
        ({"worst": 1, "best": 1}, [2, 0], 6),
        ({"worst": 4, "best": 4}, [2, 3, 1, 4, 0, 6], 6),  # Each episode appears once.
        ({"worst": 100}, [2, 3, 1, 4, 0, 6], 6),
        ({"failed": True}, [1, 2, 3, 4], 4),
        ({"failed": True, "best": 2}, [1, 4], 4),
        ({"cause": ("too late",)}, [2, 4], 2),
        ({"cause": ("too late", "too early"), "split": ("val",)}, [3], 1),
        ({"method": ("rl",), "reaches": ("real",)}, [4], 1),
        ({"seed": (1,)}, [3], 1),
        ({"row": (0,), "split": ("test",)}, [0, 4, 6], 3),
        ({"where": "return < 20 and cause != 'too late'"}, [1, 3], 2),
        ({"where": "seed == 0 and method == 'bc'", "failed": True, "worst": 1}, [2], 2),
    ],
)
def test_a_filter_selects_these_episodes(settings: dict[str, Any], rows: list[int], passing: int):
    selected, count = selection.select(TABLE, EpisodeFilter(**settings))
    assert (selected.index.tolist(), count) == (rows, passing)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"method": ("bc", "rlil")}, "no episode has method 'rlil'; choose from bc, rl"),
        ({"seed": (7,)}, "no episode has seed 7; choose from 0, 1"),
        ({"row": (3,)}, "no episode has row 3; choose from 0 to 2"),
        ({"cause": ("late",)}, "no episode has cause 'late'; choose from solved, too early, too late, knocked over, "),
        ({"cause": ("knocked over",)}, "0 of 7 episodes match the filter"),
        ({"cause": ("agent failed",)}, "1 of 7 episodes match the filter; the agent failed before their first step"),
    ],
)
def test_an_unknown_value_is_answered_with_the_valid_ones(settings: dict[str, Any], message: str):
    with pytest.raises(NoEpisodes) as caught:
        selection.select(TABLE, EpisodeFilter(**settings))
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("count", [0, -1])
def test_a_filter_for_fewer_than_one_episode_is_refused(count: int):
    with pytest.raises(BadFilter, match=f"--best {count}: select 1 episode or more"):
        EpisodeFilter(best=count)


def test_recordings_at_files_and_below_folders_are_listed_once(tmp_path: Path):
    files = [tmp_path / "a" / "recordings" / "test-0001.rrd", tmp_path / "a" / "recordings" / "test-0000.rrd"]
    files[0].parent.mkdir(parents=True)
    for file in files:
        file.touch()
    assert selection.recordings([files[0], tmp_path]) == files
    with pytest.raises(NoEpisodes, match=r"empty does not exist; "):
        selection.recordings([tmp_path / "empty"])
    (tmp_path / "empty" / "folder.rrd").mkdir(parents=True)
    with pytest.raises(NoEpisodes, match=r"no recordings at .*empty"):
        selection.recordings([tmp_path, tmp_path / "empty"])
