"""Shows a training in Rerun: its curves, and the newest episodes of each seed.

Curves and episodes share the time line `step`, the control steps of the training: an evaluation's episodes lie at the
step at which its weights were saved, one after another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk
from rerun.encodings import TimeRange
from rerun_bindings import flush_and_cleanup_orphaned_recordings

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.recording import blueprint, scene, viewer
from dextron_bench.world import task

APPLICATION = "dextron-bench-training"
STEP = "step"
COLOURS = ((90, 170, 255), (255, 150, 50), (90, 210, 140), (230, 60, 200), (255, 210, 80), (190, 120, 255))
TITLES = {  # Titles of the plots that come first, by the name of their values.
    "val/return": "Return on val, 0 to 20",
    "train/score": "Return in training, 0 to 20",
    "val/success": "Share of successes on val",
    "time/steps_per_second": "Control steps per second of a seed",
    "memory/process_MB": "Memory [MB]",
}
AHEAD = 1.25  # Share of the newest step at which the plots end, so that they need no new layout for each epoch.
FIRST = 3  # Plots that have a place of their own; the others share one as tabs.

Connect = Callable[[rr.RecordingStream], None]


class TrainingView:
    """One training in a viewer or a file."""

    def __init__(self, connect: Connect, name: str, seeds: Sequence[int]) -> None:
        """`connect` connects a stream to a viewer or to a file; `name` identifies the training."""
        rr.set_strict_mode(True)
        self._seeds, self._names = tuple(seeds), list[str]()
        self._newest = 0  # Newest step.
        self._end = 0  # Step at which the plots end.
        self._ends = dict.fromkeys(seeds, 0)
        self._stream = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
        connect(self._stream)
        self._arrange()

    def values(self, seed: int, epoch: int, step: int, values: Mapping[str, float]) -> None:
        """Adds a value to each curve of a seed."""
        times = [rr.TimeColumn(STEP, sequence=[step]), rr.TimeColumn("epoch", sequence=[epoch])]
        chunks = []
        for name, value in values.items():
            entity = f"/curves/{name}/seed{seed}"
            chunks.append(Chunk.from_columns(entity, times, rr.Scalars.columns(scalars=[value])))
        if new := [name for name in values if name not in self._names]:
            self._names += new
            chunks += [self._style(name, k) for name in new for k in self._seeds]
        self._stream.send_chunks(chunks)
        self._is_arranged &= not new and step < self._end
        self._newest = max(step, self._newest)

    def episodes(self, seed: int, step: int, titles: Sequence[str], episodes: Sequence[Episode]) -> None:
        """Adds episodes, which begin at `step` or after the last one that is there; each has a title."""
        if not self._ends[seed]:  # Before its first episode, a seed has no hand.
            self._stream.send_chunks([_below(seed, chunk) for chunk in scene.static_chunks()])
        begin = max(step, self._ends[seed])
        for title, episode in zip(titles, episodes, strict=True):
            self._stream.send_chunks(self._episode(seed, begin, title, episode))
            begin += len(episode.states)
        self._ends[seed] = begin

    def flush(self) -> None:
        """Lays out what is new; apart from this, the viewer keeps the layout, which its user may have changed."""
        if not self._is_arranged:
            self._arrange()

    def close(self) -> None:
        """Completes the file, or leaves the viewer."""
        self._arrange()
        self._stream.disconnect()
        flush_and_cleanup_orphaned_recordings()

    def _episode(self, seed: int, begin: int, title: str, episode: Episode) -> Iterator[Chunk]:
        for chunk in scene.chunks(episode.states, begin):
            if chunk.entity_path != scene.TRACE:  # The whole path of an episode appears at once, below.
                yield _below(seed, chunk)
        path = rr.LineStrips3D([task.palm_centre(episode.states)], radii=[0.0012], colors=[scene.TRACE_COLOUR])
        times = [rr.TimeColumn(STEP, sequence=[begin])]
        columns = [batch.partition([1]) for batch in path.as_component_batches()]
        yield Chunk.from_columns(f"/seed{seed}/world/path", times, columns)
        text = rr.TextDocument.columns(text=[title], media_type=["text/markdown"])
        yield Chunk.from_columns(f"/seed{seed}/card", times, text)

    def _style(self, name: str, seed: int) -> Chunk:
        colour = COLOURS[self._seeds.index(seed) % len(COLOURS)]
        style = rr.SeriesLines(names=[f"seed {seed}"], colors=[colour], widths=[2.0])
        return scene.static(f"/curves/{name}/seed{seed}", style)

    def _arrange(self) -> None:
        """Sends the layout: a column of seeds, and plots of all values that are known."""
        columns = [
            rrb.Vertical(
                blueprint.spatial_view(f"/seed{seed}", f"Seed {seed}: newest episodes"),
                rrb.TextDocumentView(origin=f"/seed{seed}/card", name=f"Seed {seed}"),
                row_shares=[4, 1],
            )
            for seed in self._seeds
        ]
        self._end = int(self._newest * AHEAD)
        order = [name for name in TITLES if name in self._names]
        order += [name for name in self._names if name not in TITLES]
        plots = [self._plot(name) for name in order]
        rest = [rrb.Tabs(*plots[FIRST:])] if plots[FIRST:] else []
        content = rrb.Horizontal(rrb.Grid(*columns), rrb.Vertical(*plots[:FIRST], *rest), column_shares=[3, 2])
        self._stream.send_blueprint(blueprint.with_time_panel(content, live=True))
        self._is_arranged = True

    def _plot(self, name: str) -> rrb.TimeSeriesView:
        limits = {"val/return": (0.0, 20.0), "train/score": (0.0, 20.0), "val/success": (0.0, 1.0)}.get(name)
        axis = rrb.ScalarAxis(range=limits, zoom_lock=True) if limits else None
        start, end = rrb.TimeRangeBoundary.absolute(seq=0), rrb.TimeRangeBoundary.absolute(seq=self._end)
        return rrb.TimeSeriesView(
            origin=f"/curves/{name}",
            name=TITLES.get(name, name),
            axis_x=rrb.archetypes.TimeAxis(view_range=TimeRange(start, end)),
            axis_y=axis,
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop),
        )


def _below(seed: int, chunk: Chunk) -> Chunk:
    """A chunk whose entity is below the root of a seed."""
    return chunk.with_entity_path(f"/seed{seed}{chunk.entity_path}")


@contextmanager
def open_training_viewer(*arguments: str) -> Iterator[tuple[Connect, Callable[[], bool]]]:
    """Opens the native viewer, which only this machine can reach.

    Yields a function that connects a stream to the viewer, and a function that says whether the viewer is still open.
    Raises ViewerError if it does not start.
    """
    port = viewer.free_port()
    with viewer.viewer_process(["--port", str(port), "--hide-welcome-screen", *arguments]) as process:
        address = viewer.address(port, process)
        yield lambda stream: stream.connect_grpc(address), lambda: process.poll() is None
