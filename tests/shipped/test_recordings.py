"""The recordings in `recordings/`: whole, small together, and played again from their own actions."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench import recording
from dextron_bench.evaluation.replay import replay
from dextron_bench.reaches import sources
from dextron_bench.world import model

FOLDER = Path(__file__).parents[2] / "recordings"
FILES = sorted(FOLDER.glob("*.rrd"))
KINDS = {"fading", "early", "expert", "policy", "wrong"}


def test_they_are_few_and_small():
    assert sum(file.stat().st_size for file in FILES) < 10e6
    assert {f"case-{kind}" for kind in KINDS} <= {file.stem for file in FILES}


def test_all_are_whole_and_say_whose_they_are():
    for summary in recording.summarise(FILES, whole=True):
        assert not summary.damage, summary
        own = summary.file.stem.startswith("sim")  # A world of minimum-jerk reaches.
        assert summary.properties["reaches"] == ("minjerk" if own else "synthetic")
        assert summary.properties["physics"] == model.mjcf_hash()
        if not summary.file.stem.startswith("case-"):
            method, _, outcome = summary.file.stem.rpartition("-")
            assert summary.properties["method"] == method
            assert (summary.properties["outcome"] == "success") == (outcome == "success")


@pytest.mark.parametrize("reaches", ["synthetic", "minjerk"])
def test_their_actions_lead_to_the_same_end_again(reaches: str):
    recorded = [recording.read(file) for file in FILES]
    episodes = [each.episode for each in recorded if each.properties["reaches"] == reaches]
    settings, actions = zip(*((each.setting, each.actions[:, 0]) for each in episodes), strict=True)
    for place, again in replay(sources.open_source(reaches), settings, actions):
        assert again.score == episodes[place].score
        assert len(again.actions) == len(episodes[place].actions)
