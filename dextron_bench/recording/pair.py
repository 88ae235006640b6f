"""Two recordings of the same setting, side by side in one."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader

from dextron_bench.recording import blueprint, rrd_file, scene
from dextron_bench.recording.episode_file import Recording
from dextron_bench.recording.summaries import PAIR, read_safely

SIDES = "/a", "/b"
PLOTS = {  # Title of each plot, what of each side is in it, and its range.
    "Action": (("/episode/actions",), (-1.1, 1.1)),
    "Hand closure": (("/signals/closure",), (-0.1, 1.1)),
    "Palm's distance, bottle's height [m]": (("/signals/metres",), (0.0, 0.7)),
    "Reward, predicted success": (("/episode/rewards", "/success/chance"), (-0.1, 1.1)),
}
SHARED = ("threshold", "lifted")  # Lines that are the same on both sides; one of each is enough.


class UnequalSettings(ValueError):
    """Two recordings that are not of the same setting."""


def write_pair(file: Path, first: Path, second: Path) -> Path:
    """Writes one recording in which two of equal settings play at once; returns it.

    Raises BrokenRecording, UnequalSettings, UnwritableRecording. It is for looking: `read` takes single episodes.
    """
    sides = [read_safely(each) for each in (first, second)]
    if sides[0].episode.setting != sides[1].episode.setting:
        raise UnequalSettings(
            f"{first} and {second} are of other settings; take two of the same row of the same split, as in "
            "`dextron-bench view --diff runs/bc/synthetic/seed0/recordings/test-0000.rrd "
            "runs/rl/synthetic/seed0/recordings/test-0000.rrd`"
        )
    chunks = [Chunk.from_property(PAIR, rr.AnyValues(a=str(first), b=str(second)))]
    for side, each in zip(SIDES, (first, second), strict=True):
        chunks += _moved(each, side)
        chunks += _lines(side)
    names = [f"{side[1:].upper()}: {_name(recorded)}" for side, recorded in zip(SIDES, sides, strict=True)]
    rrd_file.save(file, chunks, ", ".join(names), _blueprint(names), rrd_file.PAIRS)
    return file


def _name(recorded: Recording) -> str:
    told = recorded.properties
    return f"{told.get('method', 'unknown')}, seed {told['seed']}" if "seed" in told else str(told.get("method", ""))


def _moved(file: Path, side: str) -> Iterable[Chunk]:
    """What a recording shows, below the side's own root, without names of lines."""
    for chunk in RrdReader(file).store().stream().to_chunks():
        entity = str(chunk.entity_path)
        if not entity.startswith("/__") and not (chunk.is_static and entity in blueprint.LINES):
            yield chunk.with_entity_path(side + entity)


def _lines(side: str) -> Iterable[Chunk]:
    """Lines named after their side; the second side's are paler."""
    for entity, looks in blueprint.LINES.items():
        shown = [not (side == SIDES[1] and label.startswith(SHARED)) for label in looks]
        colours = [tuple(part // 2 + 110 for part in c) if side == SIDES[1] else c for c in looks.values()]
        names = [f"{side[1:].upper()}: {label}" for label in looks]
        widths = [2.0 if each else 0.0 for each in shown]
        yield scene.static(side + entity, rr.SeriesLines(names=names, colors=colours, widths=widths))


def _blueprint(names: list[str]) -> rrb.Blueprint:
    """A column for each side, and one in which their lines are together."""
    columns = [
        rrb.Vertical(
            blueprint.space(side, name), rrb.TextDocumentView(origin=f"{side}/card", name=name), row_shares=[3, 1]
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
    return blueprint.page(rrb.Horizontal(*columns, rrb.Vertical(*plots), column_shares=[4, 4, 5]))
