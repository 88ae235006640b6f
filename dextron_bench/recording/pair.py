"""Combines two recordings of the same setting in one file, side by side."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk

from dextron_bench.errors import BadInput
from dextron_bench.recording import blueprint, phase_lane, rrd_file, rrd_format, scene
from dextron_bench.recording.episode_file import Recording
from dextron_bench.recording.summaries import PAIR, read_safely

SIDES = "/a", "/b"
PLOTS = {  # Title of each plot, its entities on each side, and the range of its axis.
    "Action": (("/episode/actions",), (-1.1, 1.1)),
    "Hand closure": (("/signals/closure",), (-0.1, 1.1)),
    "Palm's distance, bottle's height [m]": (("/signals/metres",), (0.0, 0.7)),
    "Reward, predicted success": (("/episode/rewards", "/success/chance"), (-0.1, 1.1)),
}
SHARED = ("threshold", "lifted")  # Lines that are equal on both sides; only one of each is drawn.


def write_pair(file: Path, first: Path, second: Path) -> Path:
    """Writes two recordings of the same setting into one file for the viewer; returns the file.

    `read` cannot read it. Raises BrokenRecording, Failed, BadInput, UnwritableRecording.
    """
    recordings = [read_safely(source) for source in (first, second)]
    if recordings[0].episode.setting != recordings[1].episode.setting:
        raise BadInput(
            f"{first} and {second} have different settings; take two of the same row of the same split, as in "
            "`dextron-bench view --diff runs/bc/synthetic/seed0/recordings/test-0000.rrd "
            "runs/rl/synthetic/seed0/recordings/test-0000.rrd`"
        )
    chunks = [Chunk.from_property(PAIR, rr.AnyValues(a=str(first), b=str(second)))]
    for side, source in zip(SIDES, (first, second), strict=True):
        chunks += _moved_chunks(source, side)
        chunks += _line_styles(side)
    names = [f"{side[1:].upper()}: {_name(recording)}" for side, recording in zip(SIDES, recordings, strict=True)]
    rrd_file.save(file, chunks, ", ".join(names), _blueprint(names), rrd_file.PAIRS)
    return file


def _name(recording: Recording) -> str:
    run = recording.properties
    return f"{run.get('method', 'unknown')}, seed {run['seed']}" if "seed" in run else str(run.get("method", ""))


def _moved_chunks(file: Path, side: str) -> Iterable[Chunk]:
    """The visible chunks of a recording with entities below the side's root, without the styles of lines."""
    for chunk in rrd_file.read_chunks(file, rrd_format.look_at(file)):
        entity = str(chunk.entity_path)
        if not entity.startswith("/__") and not (chunk.is_static and entity in blueprint.LINES):
            yield chunk.with_entity_path(side + entity)


def _line_styles(side: str) -> Iterable[Chunk]:
    """Names and colours of a side's lines; the second side has paler colours."""
    for entity, style in blueprint.LINES.items():
        colours = [tuple(part // 2 + 110 for part in c) if side == SIDES[1] else c for c in style.values()]
        names = [f"{side[1:].upper()}: {label}" for label in style]
        widths = [0.0 if side == SIDES[1] and label.startswith(SHARED) else 2.0 for label in style]
        yield scene.static(side + entity, rr.SeriesLines(names=names, colors=colours, widths=widths))


def _blueprint(names: list[str]) -> rrb.Blueprint:
    """A column with the scene of each side, and a column with the phases and plots of both."""
    columns = [
        rrb.Vertical(
            blueprint.spatial_view(side, name),
            rrb.TextDocumentView(origin=f"{side}/card", name=name),
            row_shares=[3, 1],
        )
        for side, name in zip(SIDES, names, strict=True)
    ]
    plots = [
        rrb.TimeSeriesView(
            name=title,
            contents=[side + entity for side in SIDES for entity in entities],
            axis_y=rrb.ScalarAxis(range=span, zoom_lock=True),
        )
        for title, (entities, span) in PLOTS.items()
    ]
    lanes_and_plots = rrb.Vertical(phase_lane.view(SIDES), *plots, row_shares=[2, 3, 3, 3, 3])
    return blueprint.with_time_panel(rrb.Horizontal(*columns, lanes_and_plots, column_shares=[4, 4, 5]))
