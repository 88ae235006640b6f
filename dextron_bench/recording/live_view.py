"""Shows an episode in Rerun's viewer while it is played."""

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

RIDGE_EVERY = 5  # Steps between two updates of the ridge plot.

Connect = Callable[[rr.RecordingStream], None]  # Connects a stream to a viewer or to a file.


class LiveView:
    """One episode in the viewer, step by step: an `Observer` of `dextron_bench.success.live`."""

    def __init__(self, connect: Connect, name: str, path: reach.Trajectory, about: Mapping[str, object]) -> None:
        """Shows the scene and the palm's path, and a text with the entries of `about`."""
        rr.set_strict_mode(True)
        self._stream = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
        connect(self._stream)
        self._stream.send_blueprint(blueprint.blueprint(with_predictions=True, live=True))
        table = "\n".join(f"| {name} | {value} |" for name, value in about.items())
        text = rr.TextDocument(f"### Live\n\n| | |\n|---|---|\n{table}\n", media_type="text/markdown")
        static = [*scene.static_chunks(), *blueprint.line_styles()]
        self._stream.send_chunks([*static, scene.planned_path(path), scene.static("/card", text)])
        self._last = min(len(path.positions) - 1 + task.HOLD, task.STEP_LIMIT)

    def show(self, states: np.ndarray, actions: np.ndarray, predictions: StepPredictions) -> None:
        """Shows the last step; takes states (T, 48), actions (T, 1) and predictions of all steps so far."""
        now = len(states) - 1
        before = max(now - 1, 0)
        last = StepPredictions(
            predictions.grid,
            predictions.curves[now:],
            predictions.probabilities[now:],
            predictions.expert_actions[now:],
            predictions.duration,
        )
        chunks = [*scene.chunks(states[before:], before), *blueprint.signals(states[now:], now)]
        chunks += [blueprint.action_chunk(actions[now:], now), *success_plots.chunks(last, actions[now:], now)]
        if now == 0:
            chunks += success_plots.static_chunks(predictions.grid)
        if now % RIDGE_EVERY == 0:
            chunks += success_plots.ridge(predictions, actions[:, 0], self._last)
        self._stream.send_chunks(chunks)

    def close(self, actions: np.ndarray, predictions: StepPredictions, success: bool) -> None:
        """Colours the ridge plot by the outcome and closes the stream."""
        self._stream.send_chunks(success_plots.ridge(predictions, actions[:, 0], self._last, success))
        self._stream.disconnect()
        flush_and_cleanup_orphaned_recordings()


@contextmanager
def open_live_viewer(*arguments: str) -> Iterator[tuple[Connect, Callable[[], None]]]:
    """Opens the native viewer, which only this machine can reach.

    Yields a function that connects a stream to the viewer, and a function that waits until the user closes it. These
    functions and this one raise ViewerError if the viewer is not running.
    """
    port = viewer.free_port()
    with viewer.viewer_process(["--port", str(port), "--hide-welcome-screen", *arguments]) as process:
        address = viewer.address(port, process)

        def connect(stream: rr.RecordingStream) -> None:
            if (code := process.poll()) is not None:
                raise viewer.ViewerError(f"Rerun's viewer was closed (code {code}); no more episodes are played")
            stream.connect_grpc(address)

        yield connect, partial(viewer.wait, process)
