"""The lane of phases: a row at the start of each one, in recordings, in pairs, and not in the live view."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader

from dextron_bench import recording
from dextron_bench.evaluation.phases import CLOSE, LIFT, PHASES, REACH
from dextron_bench.recording import blueprint, phase_lane
from tests.recording.test_episode_file import PATH, episode


def rows(chunk: Chunk) -> list[tuple[int, str]]:
    batch = chunk.to_record_batch()
    columns = batch.column("step").to_pylist(), batch.column("StateChange:state").to_pylist()
    return [(step, state) for step, (state,) in zip(*columns, strict=True)]


def lanes(file: Path) -> dict[str, list[tuple[int, str]]]:
    chunks = [chunk for chunk in RrdReader(file).store().stream().to_chunks() if not chunk.is_static]
    return {str(chunk.entity_path): rows(chunk) for chunk in chunks if str(chunk.entity_path).endswith("/phase")}


def views(layout: object) -> list[str]:
    parts = getattr(layout, "contents", ()) if isinstance(layout, rrb.Container) else ()
    return [type(layout).__name__, *(name for part in parts for name in views(part))]


def test_a_phase_has_one_row_where_it_starts() -> None:
    places = np.array([REACH, REACH, CLOSE, CLOSE, LIFT, CLOSE])
    assert rows(phase_lane.chunk(places)) == [(0, "reach"), (2, "close"), (4, "lift"), (5, "close")]


def test_every_phase_has_a_colour_of_its_own() -> None:
    assert len(set(phase_lane.COLOURS)) == len(PHASES)


def test_a_recording_has_a_lane_and_a_pair_has_two(tmp_path: Path) -> None:
    played = episode(6)
    played.states[:, 2] = [0.125, 0.125, 0.125, 0.2, 0.26, 0.3, 0.3]
    files = [tmp_path / "a.rrd", tmp_path / "b.rrd"]
    for file in files:
        recording.write(file, played, PATH, {})
    lane = lanes(files[0])["/phase"]
    assert lane[-2:] == [(3, "lift"), (4, "countdown")]
    assert lanes(recording.write_pair(tmp_path / "pair.rrd", *files)) == {"/a/phase": lane, "/b/phase": lane}


def test_the_live_view_has_no_lane() -> None:
    """Where a movement of the hand begins is known only afterwards."""
    assert "StateTimelineView" in views(blueprint.blueprint().root_container)
    assert "StateTimelineView" not in views(blueprint.blueprint(True, live=True).root_container)
