"""What recordings show of the success model: every column bit for bit, and the picture by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions, expert_actions
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches.setting import Setting
from dextron_bench.recording import scene, success_plots
from dextron_bench.success.network import GRID
from dextron_bench.world import model
from tests.helpers.short_reaches import SETTINGS, SOURCE

SETTING = Setting("05_fr_05", 0.01, -0.02, 1 / 3)
CASE = Case(SETTINGS[0], Expert(1.2, 0.3), 0.1)


def noise(steps: int) -> tuple[Episode, StepPredictions]:
    rng = np.random.default_rng(0)
    states = np.concatenate([model.half_closed(), np.zeros(23)]) + rng.normal(0.0, 0.01, (steps + 1, model.STATE))
    episode = Episode(SETTING, states, rng.uniform(-1, 1, (steps, 1)), np.zeros(steps), False, True)
    curves, chances, experts = rng.random((steps, 51)), rng.random(steps), rng.uniform(-1, 1, steps)
    return episode, StepPredictions(GRID, curves, chances, experts, duration=steps - 20.0)


@pytest.fixture(scope="module")
def columns(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pa.RecordBatch]:
    """The changing columns of a recording of 150 steps, by entity."""
    file = tmp_path_factory.mktemp("foreseen") / "episode.rrd"
    episode, insight = noise(150)
    recording.write(file, episode, SOURCE.path(SETTINGS[0]), {"method": "mine"}, insight)
    assert recording.read(file).episode.actions.tobytes() == episode.actions.tobytes()
    assert file.stat().st_size < 620_000
    found = RrdReader(file).store().stream().to_chunks()
    return {str(chunk.entity_path): chunk.to_record_batch() for chunk in found if not chunk.is_static}


def flat(batch: pa.RecordBatch, name: str) -> np.ndarray:
    return batch.column(name).flatten().to_numpy()


def tensors(batch: pa.RecordBatch, name: str) -> np.ndarray:
    return np.array([row[0]["buffer"] for row in batch.column(name).to_pylist()], np.float32)


def test_curves_chances_and_actions_come_back(columns: dict[str, pa.RecordBatch]):
    episode, insight = noise(150)
    np.testing.assert_array_equal(tensors(columns["/success/curve"], "BarChart:values"), insight.curves.astype("f4"))
    chosen = columns["/success/chosen"]
    np.testing.assert_array_equal(tensors(chosen, "BarChart:values")[:, 0], insight.chances.astype("f4"))
    np.testing.assert_array_equal(tensors(chosen, "BarChart:abscissa")[:, 0], episode.actions[:, 0].astype("f4"))
    assert flat(columns["/signals/expert"], "Scalars:scalars").tobytes() == insight.experts.tobytes()
    chances = flat(columns["/success/chance"], "Scalars:scalars").reshape(-1, 2)
    assert chances[:, 0].tobytes() == insight.chances.tobytes()
    assert set(chances[:, 1]) == {0.5}


def test_a_changed_curve_is_noticed(tmp_path: Path):
    """The digest covers what the model thought: the same episode with another thought is another content."""
    episode, insight = noise(3)
    changed = StepPredictions(GRID, insight.curves.copy(), insight.chances, insight.experts, insight.duration)
    changed.curves[1, 7] += 0.25
    told = []
    for each in (insight, changed):
        recording.write(tmp_path / "e.rrd", episode, SOURCE.path(SETTINGS[0]), {}, each)
        stream = RrdReader(tmp_path / "e.rrd").store().stream().filter(content="/__properties/digest")
        told.append([chunk.to_record_batch().to_pydict()["sha256"] for chunk in stream.to_chunks()])
    assert told[0] != told[1]


def test_ridges_rise_step_by_step_and_are_green_where_the_outcome_is_foretold():
    curves = np.zeros((2, 3))
    curves[1] = [0.0, 1.0, 0.5]
    seen = StepPredictions(GRID, curves, np.array([0.2, 0.9]), np.zeros(2), duration=2.0)
    chunks = list(success_plots.ridge(seen, np.array([-1.0, 0.5]), last=1, success=True))
    ridge = next(chunk for chunk in chunks if chunk.entity_path == "/ridge/curves").to_record_batch().to_pydict()
    strips, colours = ridge["LineStrips2D:strips"][0], ridge["LineStrips2D:colors"][0]
    np.testing.assert_allclose(strips[0], [[-1, 0], [0, 0], [1, 0]])
    np.testing.assert_allclose(strips[1], [[-1, -5.0], [0, -5.4], [1, -5.2]], atol=1e-6)
    red, green = (int.from_bytes([*colour, 255]) for colour in (success_plots.WRONG, success_plots.RIGHT))
    assert colours == [red, green, *[int.from_bytes([*success_plots.TICK, 255])] * 2]
    np.testing.assert_allclose(strips[3], [[0.5, -5.0], [0.5, -5.2]], atol=1e-6)


def test_the_experts_actions_in_its_own_states_are_those_it_took():
    (_, episode), *_ = rollout(ExpertAgent(), SOURCE, [CASE], threads=1)
    np.testing.assert_array_equal(expert_actions(CASE.expert, episode.states[:-1]), episode.actions[:, 0])


def test_contacts_are_where_the_hand_touches_the_bottle():
    (_, episode), *_ = rollout(ExpertAgent(), SOURCE, [Case(SETTINGS[0], Expert(1.4, 0.17), 0.1)], threads=1)
    _, _, touched = scene.poses(episode.states)
    assert not len(touched[0])
    points = np.concatenate(touched)
    bottle = np.repeat(episode.states[:, :3], [len(each) for each in touched], axis=0)
    assert len(points)
    assert np.linalg.norm(points[:, :2] - bottle[:, :2], axis=1).max() < 0.15
