"""A pair shows everything that its two recordings show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from dextron_bench import recording
from dextron_bench.errors import BadInput
from dextron_bench.evaluation.replay import replay
from tests.helpers.short_reaches import SETTINGS, SOURCE


def recorded(file: Path, index: int, speed: float, method: str) -> Path:
    setting = SETTINGS[index]
    ((_, episode),) = replay(SOURCE, [setting], [np.full(12, speed)], threads=1)
    recording.write(file, episode, SOURCE.path(setting), {"method": method, "seed": 0})
    return file


def test_each_side_has_a_scene_and_lines(tmp_path: Path):
    first, second = recorded(tmp_path / "1.rrd", 0, 0.5, "bc"), recorded(tmp_path / "2.rrd", 0, -0.25, "rl")
    file = recording.write_pair(tmp_path / "both.rrd", first, second)
    chunks = RrdReader(file).store().stream().to_chunks()
    actions = {str(c.entity_path): c for c in chunks if str(c.entity_path).endswith("/actions") and not c.is_static}
    for entity, speed in {"/a/episode/actions": 0.5, "/b/episode/actions": -0.25}.items():
        values = actions[entity].to_record_batch().column("Scalars:scalars").flatten().to_numpy()
        np.testing.assert_array_equal(values, np.full(12, speed))
    names = [c.to_record_batch().to_pydict() for c in chunks if c.is_static and c.entity_path == "/b/episode/actions"]
    assert names[0]["SeriesLines:names"] == [["B: action"]]
    entities = {str(chunk.entity_path) for chunk in chunks}
    assert {f"{side}{entity}" for side in "ab" for entity in ("/world/palm", "/card")} <= {e[1:] for e in entities}


def test_different_settings_are_refused(tmp_path: Path):
    first, second = recorded(tmp_path / "1.rrd", 0, 0.5, "bc"), recorded(tmp_path / "2.rrd", 1, 0.5, "bc")
    with pytest.raises(BadInput, match="take two of the same row"):
        recording.write_pair(tmp_path / "both.rrd", first, second)
    assert not (tmp_path / "both.rrd").exists()
