"""What the success model thinks while an episode runs: a bar chart at the cursor, and a ridge for all its steps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk
from rerun.encodings import TensorDataBatch

from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.recording import scene

RIDGES = 40  # Curves of the ridge plot, about.
WIDTH, HEIGHT, RISE = 1.0, 5.0, 0.4  # Half the ridge plot's width, its height, and that of a curve of chance 1.
RIGHT, WRONG, NOW, TICK = (90, 210, 140), (255, 90, 60), (255, 255, 255), (255, 190, 60)
BARS, FRAME = (90, 150, 230), (150, 155, 165)
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # Of the reach's duration, at which the ridge plot tells the time.
THRESHOLD = 0.5  # A chance above it foretells success.


def chunks(insight: StepPredictions, actions: np.ndarray, first: int = 0) -> Iterable[Chunk]:
    """What changes with the cursor, for the actions (T, 1) that were taken from step `first` on."""
    steps = len(insight.chances)
    when = scene.timelines(first, first + steps - 1)
    foretold = np.stack([insight.chances, np.full(steps, THRESHOLD)], axis=1)
    yield Chunk.from_columns("/success/chance", when, rr.Scalars.columns(scalars=foretold))
    yield Chunk.from_columns("/signals/expert", when, rr.Scalars.columns(scalars=insight.experts))
    yield Chunk.from_columns("/success/curve", when, rr.BarChart.columns(values=_tensors(insight.curves)))
    chosen = rr.BarChart.columns(values=_tensors(insight.chances[:, None]), abscissa=_tensors(actions))
    yield Chunk.from_columns("/success/chosen", when, chosen)


def ridge(insight: StepPredictions, actions: np.ndarray, last: int, success: bool | None = None) -> Iterable[Chunk]:
    """The curves of an episode that ends at step `last`, one above the other, later ones higher; actions are (T,).

    They are green where the outcome is foretold, red where it is not, and blue while it is not known. After them come
    as many ticks, at the actions that were taken.
    """
    steps, grid = len(actions), np.linspace(-WIDTH, WIDTH, insight.curves.shape[1])
    base = -HEIGHT * np.arange(steps) / max(last, 1)  # The view's y goes down.
    strips = np.stack([np.broadcast_to(grid, insight.curves.shape), base[:, None] - RISE * insight.curves], axis=2)
    strips = strips.astype(np.float32)
    shown = np.arange(0, steps, max(1, last // RIDGES))
    right = (insight.chances[shown] > THRESHOLD) == success
    colours = np.where(right[:, None], RIGHT, WRONG) if success is not None else np.array([BARS])
    ticks = np.stack([actions, base, actions, base - RISE / 2], axis=1).reshape(-1, 2, 2).astype(np.float32)
    lines, tick = [*strips[shown], *ticks[shown]], np.tile(TICK, (len(shown), 1))
    colours = np.concatenate([np.broadcast_to(colours, tick.shape), tick]).astype(np.uint8)
    yield scene.static(
        "/ridge/curves", rr.LineStrips2D(lines, colors=colours, radii=np.repeat([0.008, 0.012], len(shown)))
    )
    yield scene.static("/ridge/axis", *_axis(insight.duration, last))
    when = scene.timelines(0, steps - 1)
    now = np.stack([[[-1.1 * WIDTH, y], [1.1 * WIDTH, y]] for y in base]).astype(np.float32)
    yield Chunk.from_columns("/ridge/now", when, rr.LineStrips2D.columns(strips=now))


def static_chunks(grid: np.ndarray) -> list[Chunk]:
    """What all episodes share: colours, places of the bars on the grid (A,) of actions, and two bars of 1 as scale."""
    ends, places = [-1.1, 1.1], len(grid)
    return [
        _look("/success/curve", rr.BarChart(grid, abscissa=grid, widths=np.full(places, 0.036), color=BARS)),
        _look("/success/chosen", rr.BarChart([0.0], widths=[0.03], color=TICK), "abscissa"),
        scene.static("/ridge/now", rr.LineStrips2D.from_fields(colors=[NOW], radii=[0.008])),
        scene.static("/success/scale", rr.BarChart([1.0, 1.0], abscissa=ends, widths=[0.02, 0.02], color=FRAME)),
    ]


def _look(entity: str, bars: rr.BarChart, *changing: str) -> Chunk:
    """What of a bar chart is the same at every step: all but its values, which Rerun wants to see first."""
    left_out = [f"BarChart:{name}" for name in ("values", *changing)]
    batches = [batch for batch in bars.as_component_batches() if batch.component_descriptor().component not in left_out]
    return Chunk.from_columns(entity, [], [batch.partition([len(batch.as_arrow_array())]) for batch in batches])


def _axis(duration: float, last: int) -> tuple[rr.LineStrips2D, rr.Points2D]:
    """What the sides of the plot are, and times as shares of the reach, with a line where it ends."""
    there = [share for share in SHARES if share * duration <= max(last, 1)]
    heights = [-HEIGHT * share * duration / max(last, 1) for share in there]
    places = [[-WIDTH, 0.15], [0.0, 0.15], [WIDTH, 0.15], *([-1.12 * WIDTH, height] for height in heights)]
    labels = ["open", "action", "close", *(f"{share:.0%}" for share in there)]
    line = [[[-WIDTH, heights[-1]], [WIDTH, heights[-1]]]] if there[-1] == 1.0 else []
    marks = rr.Points2D(places, labels=labels, radii=[0.001], colors=[FRAME], show_labels=True)
    return rr.LineStrips2D(line, colors=[FRAME], radii=[0.006]), marks


def _tensors(rows: np.ndarray) -> pa.Array:
    """One Arrow tensor (A,) for each row of (T, A); Rerun itself makes no batches of tensors."""
    kind, count = TensorDataBatch._ARROW_DATATYPE, len(rows)
    assert kind is not None
    union = kind.field("buffer").type
    fields = [union.field(i) for i in range(union.num_fields)]
    place = [field.name for field in fields].index("F32")
    children = [pa.array([], field.type) for field in fields]
    children[place] = _lists(fields[place].type, pa.array(rows.astype(np.float32).ravel()), count)
    codes, offsets = np.full(count, place, np.int8), np.arange(count, dtype=np.int32)
    held = [None, pa.py_buffer(codes), pa.py_buffer(offsets)]
    columns = [
        _lists(kind.field("shape").type, pa.array(np.full(count, rows.shape[1], np.uint64)), count),
        _lists(kind.field("names").type, pa.array([], pa.string()), count),
        pa.Array.from_buffers(union, count, held, children=children),
    ]
    return pa.StructArray.from_arrays(columns, fields=[kind.field(i) for i in range(kind.num_fields)])


def _lists(kind: pa.DataType, values: pa.Array, count: int) -> pa.Array:
    """Values cut into so many lists of equal length."""
    offsets = pa.array(np.arange(count + 1, dtype=np.int32) * (len(values) // count))
    return pa.Array.from_buffers(kind, count, [None, offsets.buffers()[1]], children=[values])
