"""The layout of recordings: activated in the file, with outcomes in words and signals in metres."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from dextron_bench import recording
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.recording import blueprint
from dextron_bench.success.network import GRID
from dextron_bench.world import task
from tests.recording.test_episode_file import PATH, PROPERTIES, episode


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An undamaged recording; tests damage copies of it."""
    file = tmp_path_factory.mktemp("whole") / "episode.rrd"
    recording.write(file, episode(20), PATH, PROPERTIES)
    return file


@pytest.mark.slow
def test_each_layout_has_its_own_application_id(tmp_path: Path) -> None:
    """The viewer has one layout for each application id: the layout of the last file that it opened."""
    files = [tmp_path / name for name in ("plain.rrd", "predicted.rrd", "pair.rrd")]
    recording.write(files[0], episode(2), PATH, {})
    recording.write(
        files[1], episode(2), PATH, {}, StepPredictions(GRID, np.full((2, 51), 0.5), np.zeros(2), np.zeros(2), 2.0)
    )
    recording.write_pair(files[2], *files[:2])
    applications = [RrdReader(file).recordings()[0].application_id for file in files]
    assert applications == ["dextron-bench-plain", "dextron-bench", "dextron-bench-pairs"]
    assert [summary.damage for summary in recording.summarise(files, whole=True)] == ["", "", ""]


def test_it_opens_with_its_own_layout(whole: Path) -> None:
    """Without an active blueprint the viewer chooses a layout itself, and a bad one."""
    printed = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", str(whole)], capture_output=True, text=True, check=True
    )
    activated = re.findall(
        r'BlueprintActivationCommand\(.*"(.+)"\), make_active: false, make_default: true', printed.stdout
    )
    [layout] = RrdReader(whole).blueprints()
    assert activated == [layout.recording_id]
    views = [str(chunk.entity_path) for chunk in RrdReader(whole).stream(store=layout).to_chunks()]
    assert sum(path.startswith("/view/") and path.count("/") == 2 for path in views) == 1 + 1 + 1 + len(blueprint.PLOTS)


@pytest.mark.parametrize(
    ("rewards", "ends", "outcome"),
    [
        (np.ones(20), {}, "success"),
        (np.ones(17), {}, "held too briefly"),
        (np.zeros(3), {}, "not lifted"),
        (np.zeros(3), {"terminated": True, "truncated": False}, "bottle fell"),
        (np.ones(20), {"truncated": False, "failure": "action is nan"}, "agent failed"),
    ],
)
def test_outcomes_in_words(rewards: np.ndarray, ends: dict[str, Any], outcome: str) -> None:
    played = episode(len(rewards), **ends)
    played.rewards[:] = rewards
    assert blueprint.outcome(played) == outcome


def test_plots_show_distance_and_height_in_metres(whole: Path) -> None:
    states = recording.read(whole).episode.states
    chunk = next(chunk for chunk in blueprint.signals(states) if chunk.entity_path == "/signals/metres")
    values = np.array(chunk.to_record_batch().column("Scalars:scalars").to_pylist())
    np.testing.assert_array_equal(values[:, 0], task.distance(states))
    np.testing.assert_array_equal(values[:, 1], states[:, 2])
