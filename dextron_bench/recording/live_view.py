"""An episode shown in the viewer while it is played."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial

import numpy as np
import rerun as rr
from rerun_bindings import flush_and_cleanup_orphaned_recordings

from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.reaches import reach
from dextron_bench.recording import blueprint, scene, success_plots, viewer
from dextron_bench.recording.rrd_file import APPLICATION
from dextron_bench.world import task

EVERY = 5  # Steps after which the ridge plot is drawn again.

Connect = Callable[[rr.RecordingStream], None]  # Says where a stream goes.


class LiveView:
    """The viewer's picture of one episode under way."""

    def __init__(self, connect: Connect, name: str, path: reach.Path, about: Mapping[str, object]) -> None:
        """Shows hand, bottle and path before the first step."""
        rr.set_strict_mode(True)
        self._stream = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
        connect(self._stream)
        self._stream.send_blueprint(blueprint.blueprint(foretold=True, live=True))
        table = "\n".join(f"| {name} | {value} |" for name, value in about.items())
        text = rr.TextDocument(f"### Live\n\n| | |\n|---|---|\n{table}\n", media_type="text/markdown")
        props = [
            *scene.static_chunks(),
            *blueprint.line_styles(),
            scene.planned_path(path),
            scene.static("/card", text),
        ]
        self._stream.send_chunks(props)
        self._last = min(len(path.positions) - 1 + task.HOLD, task.STEP_LIMIT)

    def show(self, states: np.ndarray, actions: np.ndarray, insight: StepPredictions) -> None:
        """Shows the last of the states (T, 48), actions (T, 1) and thoughts of an episode so far."""
        now = len(states) - 1
        before = max(now - 1, 0)
        part = StepPredictions(
            insight.grid, insight.curves[now:], insight.chances[now:], insight.experts[now:], insight.duration
        )
        chunks = [*scene.chunks(states[before:], before), *blueprint.signals(states[now:], now)]
        chunks += [blueprint.action_chunk(actions[now:], now), *success_plots.chunks(part, actions[now:], now)]
        if now == 0:
            chunks += success_plots.static_chunks(insight.grid)
        if now % EVERY == 0:
            chunks += success_plots.ridge(insight, actions[:, 0], self._last)
        self._stream.send_chunks(chunks)

    def close(self, actions: np.ndarray, insight: StepPredictions, success: bool) -> None:
        """Colours the ridge plot by the outcome, and lets go of the stream."""
        self._stream.send_chunks(success_plots.ridge(insight, actions[:, 0], self._last, success))
        self._stream.disconnect()
        flush_and_cleanup_orphaned_recordings()


@contextmanager
def open_live_viewer(*arguments: str) -> Iterator[tuple[Connect, Callable[[], None]]]:
    """The native viewer, reachable from this machine only: how streams reach it, and how to wait until it is closed.

    Both raise ViewerError where it is gone, as does this.
    """
    port = viewer.free_port()
    with viewer.viewer_process(["--port", str(port), "--hide-welcome-screen", *arguments]) as opened:
        where = viewer.address(port, opened)

        def connect(stream: rr.RecordingStream) -> None:
            if opened.poll() is not None:
                raise viewer.ViewerError(f"Rerun's viewer is gone (code {opened.returncode}); nothing more is played")
            stream.connect_grpc(where)

        yield connect, partial(viewer.wait, opened)
