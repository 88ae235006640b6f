"""Plots of the success model's predictions: a bar chart at the cursor, and a ridge plot of all steps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk
from rerun.encodings import TensorDataBatch

from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.recording import scene

RIDGES = 40  # Approximate number of curves in the ridge plot.
WIDTH, HEIGHT, RISE = 1.0, 5.0, 0.4  # Half the ridge plot's width, its height, and the height of a curve at chance 1.
RIGHT, WRONG, NOW, TICK = (90, 210, 140), (255, 90, 60), (255, 255, 255), (255, 190, 60)
BARS, FRAME = (90, 150, 230), (150, 155, 165)
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # Shares of the reach's duration that are marked on the ridge plot.
THRESHOLD = 0.5  # The model predicts success if the chance is above this.


def chunks(predictions: StepPredictions, actions: np.ndarray, first: int = 0) -> Iterable[Chunk]:
    """Predictions at each step, which the viewer shows at the cursor, for the actions (T, 1) from step `first` on."""
    steps = len(predictions.probabilities)
    times = scene.timelines(first, first + steps - 1)
    chances = np.stack([predictions.probabilities, np.full(steps, THRESHOLD)], axis=1)
    yield Chunk.from_columns("/success/chance", times, rr.Scalars.columns(scalars=chances))
    yield Chunk.from_columns("/signals/expert", times, rr.Scalars.columns(scalars=predictions.expert_actions))
    yield Chunk.from_columns("/success/curve", times, rr.BarChart.columns(values=_tensors(predictions.curves)))
    chosen = rr.BarChart.columns(values=_tensors(predictions.probabilities[:, None]), abscissa=_tensors(actions))
    yield Chunk.from_columns("/success/chosen", times, chosen)


def ridge(predictions: StepPredictions, actions: np.ndarray, last: int, success: bool | None = None) -> Iterable[Chunk]:
    """The ridge plot for actions (T,) of an episode that ends at step `last`; later curves are higher.

    A curve is green if the model predicts the outcome correctly, red if not, and blue if the outcome is not known yet.
    After the curves come the same number of ticks, which mark the agent's actions.
    """
    steps, grid = len(actions), np.linspace(-WIDTH, WIDTH, predictions.curves.shape[1])
    base = -HEIGHT * np.arange(steps) / max(last, 1)  # The view's y goes down.
    strips = np.stack(
        [np.broadcast_to(grid, predictions.curves.shape), base[:, None] - RISE * predictions.curves], axis=2
    )
    strips = strips.astype(np.float32)
    shown = np.arange(0, steps, max(1, last // RIDGES))
    correct = (predictions.probabilities[shown] > THRESHOLD) == success
    colours = np.where(correct[:, None], RIGHT, WRONG) if success is not None else np.array([BARS])
    ticks = np.stack([actions, base, actions, base - RISE / 2], axis=1).reshape(-1, 2, 2).astype(np.float32)
    lines, tick_colours = [*strips[shown], *ticks[shown]], np.tile(TICK, (len(shown), 1))
    colours = np.concatenate([np.broadcast_to(colours, tick_colours.shape), tick_colours]).astype(np.uint8)
    yield scene.static(
        "/ridge/curves", rr.LineStrips2D(lines, colors=colours, radii=np.repeat([0.008, 0.012], len(shown)))
    )
    yield scene.static("/ridge/axis", *_axis(predictions.duration, last))
    times = scene.timelines(0, steps - 1)
    now = np.stack([[[-1.1 * WIDTH, y], [1.1 * WIDTH, y]] for y in base]).astype(np.float32)
    yield Chunk.from_columns("/ridge/now", times, rr.LineStrips2D.columns(strips=now))


def static_chunks(grid: np.ndarray) -> list[Chunk]:
    """What is equal for all episodes: colours, bars at the actions `grid` (A,), and two bars of height 1 as a scale."""
    ends, widths = [-1.1, 1.1], np.full(len(grid), 0.036)
    return [
        _bar_style("/success/curve", rr.BarChart(grid, abscissa=grid, widths=widths, color=BARS)),
        _bar_style("/success/chosen", rr.BarChart([0.0], widths=[0.03], color=TICK), "abscissa"),
        scene.static("/ridge/now", rr.LineStrips2D.from_fields(colors=[NOW], radii=[0.008])),
        scene.static("/success/scale", rr.BarChart([1.0, 1.0], abscissa=ends, widths=[0.02, 0.02], color=FRAME)),
    ]


def _bar_style(entity: str, bars: rr.BarChart, *changing: str) -> Chunk:
    """A bar chart without its values and other `changing` fields, which are logged at each step."""
    omitted = [f"BarChart:{name}" for name in ("values", *changing)]
    batches = [batch for batch in bars.as_component_batches() if batch.component_descriptor().component not in omitted]
    return Chunk.from_columns(entity, [], [batch.partition([len(batch.as_arrow_array())]) for batch in batches])


def _axis(duration: float, last: int) -> tuple[rr.LineStrips2D, rr.Points2D]:
    """Labels of the ridge plot: actions, times as shares of the reach, and a line at the end of the reach."""
    shares = [share for share in SHARES if share * duration <= max(last, 1)]
    heights = [-HEIGHT * share * duration / max(last, 1) for share in shares]
    positions = [[-WIDTH, 0.15], [0.0, 0.15], [WIDTH, 0.15], *([-1.12 * WIDTH, height] for height in heights)]
    labels = ["open", "action", "close", *(f"{share:.0%}" for share in shares)]
    line = [[[-WIDTH, heights[-1]], [WIDTH, heights[-1]]]] if shares[-1] == 1.0 else []
    marks = rr.Points2D(positions, labels=labels, radii=[0.001], colors=[FRAME], show_labels=True)
    return rr.LineStrips2D(line, colors=[FRAME], radii=[0.006]), marks


def _tensors(rows: np.ndarray) -> pa.Array:
    """One Arrow tensor (A,) for each row of (T, A), because Rerun has no batches of tensors."""
    kind, count = TensorDataBatch._ARROW_DATATYPE, len(rows)
    assert kind is not None
    union = kind.field("buffer").type
    fields = [union.field(i) for i in range(union.num_fields)]
    index = [field.name for field in fields].index("F32")
    children = [pa.array([], field.type) for field in fields]
    children[index] = _lists(fields[index].type, pa.array(rows.astype(np.float32).ravel()), count)
    codes, offsets = np.full(count, index, np.int8), np.arange(count, dtype=np.int32)
    buffers = [None, pa.py_buffer(codes), pa.py_buffer(offsets)]
    columns = [
        _lists(kind.field("shape").type, pa.array(np.full(count, rows.shape[1], np.uint64)), count),
        _lists(kind.field("names").type, pa.array([], pa.string()), count),
        pa.Array.from_buffers(union, count, buffers, children=children),
    ]
    return pa.StructArray.from_arrays(columns, fields=[kind.field(i) for i in range(kind.num_fields)])


def _lists(kind: pa.DataType, values: pa.Array, count: int) -> pa.Array:
    """An array of `count` lists of equal length, from all their values in order."""
    offsets = pa.array(np.arange(count + 1, dtype=np.int32) * (len(values) // count))
    return pa.Array.from_buffers(kind, count, [None, offsets.buffers()[1]], children=[values])
