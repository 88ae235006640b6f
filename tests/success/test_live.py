"""A policy plays the same actions when it is shown live, and every step is shown."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.recording import viewer
from dextron_bench.splits.rows import Rows
from dextron_bench.success import live
from dextron_bench.success.network import SIZES, SuccessModel
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASE = Case(SETTINGS[0], Expert(1.4, 0.17), 0.1)
ROW = Rows(cases=(CASE,))
RNG = np.random.default_rng(0)
LAYERS = {f"layer.{i}": RNG.normal(size=shape) / shape[-1] ** 0.5 for i, shape in enumerate(SIZES)}
MODEL = SuccessModel(LAYERS | {"mean": np.zeros(48), "deviation": np.ones(48)})


class Recorder:
    """An observer that keeps all that it receives."""

    def __init__(self) -> None:
        self.shown: list[tuple[np.ndarray, np.ndarray, StepPredictions]] = []
        self.outcome: bool | None = None

    def show(self, states: np.ndarray, actions: np.ndarray, predictions: StepPredictions) -> None:
        self.shown.append((states, actions, predictions))

    def close(self, actions: np.ndarray, predictions: StepPredictions, success: bool) -> None:
        self.outcome = success


def rolled_out() -> Episode:
    """The same episode without an observer."""
    ((_, episode),) = rollout(ExpertAgent(), SOURCE, [CASE], threads=1)
    return episode


@pytest.mark.slow
def test_every_step_is_shown_as_it_is_taken():
    recorder, episode = Recorder(), rolled_out()
    assert live.play(ExpertAgent(), SOURCE, ROW, MODEL, recorder, speed=0).states.tobytes() == episode.states.tobytes()
    assert len(recorder.shown) == len(episode.actions)
    for step, (states, actions, predictions) in enumerate(recorder.shown, start=1):
        np.testing.assert_array_equal(states, episode.states[:step])
        np.testing.assert_array_equal(actions, episode.actions[:step])
        assert len(predictions.curves) == len(predictions.probabilities) == step
    np.testing.assert_array_equal(recorder.shown[-1][2].expert_actions, episode.actions[:, 0])
    np.testing.assert_array_equal(recorder.shown[-1][2].curves, MODEL.curve(episode.states[:-1]))
    assert recorder.outcome == episode.success


def test_a_closed_viewer_is_an_error_before_the_next_episode(monkeypatch: pytest.MonkeyPatch):
    @contextmanager
    def process(arguments: list[str]) -> Iterator[subprocess.Popen[bytes]]:
        with subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"]) as opened:
            opened.wait()
            yield opened

    monkeypatch.setattr(viewer, "viewer_process", process)
    monkeypatch.setattr(viewer, "address", lambda port, opened: "nowhere")
    with recording.open_live_viewer() as (connect, wait):
        with pytest.raises(recording.ViewerError, match=r"closed .code 3.; no more episodes are played"):
            recording.LiveView(connect, "live", SOURCE.path(CASE.setting), {})
        with pytest.raises(recording.ViewerError, match="ended with code 3"):
            wait()


@pytest.mark.slow
def test_the_live_view_draws_all_steps(tmp_path: Path):
    file, episode = tmp_path / "live.rrd", rolled_out()
    view = recording.LiveView(lambda stream: stream.save(file), "live", SOURCE.path(CASE.setting), {"method": "exp"})
    live.play(ExpertAgent(), SOURCE, ROW, MODEL, view, speed=0)
    chunks = [chunk for chunk in RrdReader(file).store().stream().to_chunks() if not chunk.is_static]
    entities = {str(chunk.entity_path) for chunk in chunks}
    assert {"/world/palm", "/world/bottle", "/success/curve", "/success/chosen", "/ridge/now"} <= entities
    rows = [chunk.to_record_batch() for chunk in chunks if chunk.entity_path == "/episode/actions"]
    shown = {step: value for batch in rows for step, value in zip(*_columns(batch), strict=True)}
    assert [shown[step] for step in range(len(episode.actions))] == episode.actions[:, 0].tolist()


def _columns(batch) -> tuple[list[int], list[float]]:
    return batch.column("step").to_pylist(), batch.column("Scalars:scalars").flatten().to_pylist()
