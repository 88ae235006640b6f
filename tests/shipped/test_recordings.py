"""The recordings in `recordings/` are undamaged and small, and a replay of their actions gives the same returns."""

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


def test_the_shipped_recordings_are_small():
    assert sum(file.stat().st_size for file in FILES) < 10e6
    assert {f"case-{kind}" for kind in KINDS} <= {file.stem for file in FILES}


@pytest.mark.slow
def test_the_shipped_recordings_are_undamaged_and_have_the_properties_of_their_run():
    for summary in recording.summarise(FILES, whole=True):
        assert not summary.damage, summary
        assert summary.properties["reaches"] == "synthetic"
        assert summary.properties["physics"] == model.mjcf_hash()
        if not summary.file.stem.startswith("case-"):
            method, _, outcome = summary.file.stem.rpartition("-")
            assert summary.properties["method"] == method
            assert (summary.properties["outcome"] == "success") == (outcome == "success")


@pytest.mark.slow
def test_a_replay_of_the_shipped_recordings_gives_the_same_returns():
    episodes = [recording.read(file).episode for file in FILES]
    settings, actions = zip(*((episode.setting, episode.actions[:, 0]) for episode in episodes), strict=True)
    for index, replayed in replay(sources.open_source("synthetic"), settings, actions):
        assert replayed.score == episodes[index].score
        assert len(replayed.actions) == len(episodes[index].actions)
