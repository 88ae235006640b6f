"""A watched policy plays as one that nobody watches, and all it does is shown."""

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
from dextron_bench.success import live
from dextron_bench.success.network import SIZES, SuccessModel
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASE = Case(SETTINGS[0], Expert(1.4, 0.17), 0.1)
RNG = np.random.default_rng(0)
LAYERS = {f"layer.{i}": RNG.normal(size=shape) / shape[-1] ** 0.5 for i, shape in enumerate(SIZES)}
MODEL = SuccessModel(LAYERS | {"mean": np.zeros(48), "deviation": np.ones(48)})


class Notebook:
    """An audience that keeps what it was shown."""

    def __init__(self) -> None:
        self.shown: list[tuple[np.ndarray, np.ndarray, StepPredictions]] = []
        self.outcome: bool | None = None

    def show(self, states: np.ndarray, actions: np.ndarray, insight: StepPredictions) -> None:
        self.shown.append((states, actions, insight))

    def close(self, actions: np.ndarray, insight: StepPredictions, success: bool) -> None:
        self.outcome = success


def alone() -> Episode:
    ((_, episode),) = rollout(ExpertAgent(), SOURCE, [CASE], threads=1)
    return episode


def test_every_step_is_shown_as_it_is_taken():
    notebook, episode = Notebook(), alone()
    assert live.play(ExpertAgent(), SOURCE, CASE, MODEL, notebook, speed=0).states.tobytes() == episode.states.tobytes()
    assert len(notebook.shown) == len(episode.actions)
    for step, (states, actions, insight) in enumerate(notebook.shown, start=1):
        np.testing.assert_array_equal(states, episode.states[:step])
        np.testing.assert_array_equal(actions, episode.actions[:step])
        assert len(insight.curves) == len(insight.chances) == step
    np.testing.assert_array_equal(notebook.shown[-1][2].experts, episode.actions[:, 0])
    np.testing.assert_array_equal(notebook.shown[-1][2].curves, MODEL.curve(episode.states[:-1]))
    assert notebook.outcome == episode.success


def test_a_viewer_that_is_gone_is_told_before_more_is_played(monkeypatch: pytest.MonkeyPatch):
    @contextmanager
    def process(arguments: list[str]) -> Iterator[subprocess.Popen[bytes]]:
        with subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"]) as opened:
            opened.wait()
            yield opened

    monkeypatch.setattr(viewer, "viewer_process", process)
    monkeypatch.setattr(viewer, "address", lambda port, opened: "nowhere")
    with recording.open_live_viewer() as (connect, wait):
        with pytest.raises(recording.ViewerError, match=r"gone .code 3.; nothing more is played"):
            recording.LiveView(connect, "live", SOURCE.path(CASE.setting), {})
        with pytest.raises(recording.ViewerError, match="ended with code 3"):
            wait()


def test_a_stage_draws_all_of_it(tmp_path: Path):
    file, episode = tmp_path / "live.rrd", alone()
    stage = recording.LiveView(lambda stream: stream.save(file), "live", SOURCE.path(CASE.setting), {"method": "exp"})
    live.play(ExpertAgent(), SOURCE, CASE, MODEL, stage, speed=0)
    chunks = [chunk for chunk in RrdReader(file).store().stream().to_chunks() if not chunk.is_static]
    entities = {str(chunk.entity_path) for chunk in chunks}
    assert {"/world/palm", "/world/bottle", "/success/curve", "/success/chosen", "/ridge/now"} <= entities
    rows = [chunk.to_record_batch() for chunk in chunks if chunk.entity_path == "/episode/actions"]
    found = {step: value for batch in rows for step, value in zip(*_columns(batch), strict=True)}
    assert [found[step] for step in range(len(episode.actions))] == episode.actions[:, 0].tolist()


def _columns(batch) -> tuple[list[int], list[float]]:
    return batch.column("step").to_pylist(), batch.column("Scalars:scalars").flatten().to_pylist()
