"""Predictions in recordings: every column bit for bit, and the ridge plot by hand."""

from __future__ import annotations

from dataclasses import replace
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
    states = np.concatenate([model.initial_qpos(), np.zeros(23)]) + rng.normal(0.0, 0.01, (steps + 1, model.STATE))
    episode = Episode(SETTING, states, rng.uniform(-1, 1, (steps, 1)), np.zeros(steps), False, True)
    curves, chances, experts = rng.random((steps, 51)), rng.random(steps), rng.uniform(-1, 1, steps)
    return episode, StepPredictions(GRID, curves, chances, experts, duration=steps - 20.0)


@pytest.fixture(scope="module")
def columns(tmp_path_factory: pytest.TempPathFactory) -> dict[str, pa.RecordBatch]:
    """The columns of a recording of 150 steps that are not static, by entity."""
    file = tmp_path_factory.mktemp("predicted") / "episode.rrd"
    episode, predictions = noise(150)
    recording.write(file, episode, SOURCE.path(SETTINGS[0]), {"method": "mine"}, predictions)
    assert recording.read(file).episode.actions.tobytes() == episode.actions.tobytes()
    assert file.stat().st_size < 800_000
    chunks = RrdReader(file).store().stream().to_chunks()
    return {str(chunk.entity_path): chunk.to_record_batch() for chunk in chunks if not chunk.is_static}


def flat(batch: pa.RecordBatch, name: str) -> np.ndarray:
    return batch.column(name).flatten().to_numpy()


def tensors(batch: pa.RecordBatch, name: str) -> np.ndarray:
    return np.array([row[0]["buffer"] for row in batch.column(name).to_pylist()], np.float32)


def test_curves_chances_and_actions_come_back(columns: dict[str, pa.RecordBatch]):
    episode, predictions = noise(150)
    np.testing.assert_array_equal(
        tensors(columns["/success/curve"], "BarChart:values"), predictions.curves.astype("f4")
    )
    chosen = columns["/success/chosen"]
    np.testing.assert_array_equal(tensors(chosen, "BarChart:values")[:, 0], predictions.probabilities.astype("f4"))
    np.testing.assert_array_equal(tensors(chosen, "BarChart:abscissa")[:, 0], episode.actions[:, 0].astype("f4"))
    assert flat(columns["/signals/expert"], "Scalars:scalars").tobytes() == predictions.expert_actions.tobytes()
    chances = flat(columns["/success/chance"], "Scalars:scalars").reshape(-1, 2)
    assert chances[:, 0].tobytes() == predictions.probabilities.tobytes()
    assert set(chances[:, 1]) == {0.5}


def test_a_changed_curve_is_noticed(tmp_path: Path):
    """The digest covers predictions: the same episode with another prediction has another digest."""
    episode, predictions = noise(3)
    changed = replace(predictions, curves=predictions.curves.copy())
    changed.curves[1, 7] += 0.25
    digests = []
    for written in (predictions, changed):
        recording.write(tmp_path / "e.rrd", episode, SOURCE.path(SETTINGS[0]), {}, written)
        stream = RrdReader(tmp_path / "e.rrd").store().stream().filter(content="/__properties/digest")
        digests.append([chunk.to_record_batch().to_pydict()["sha256"] for chunk in stream.to_chunks()])
    assert digests[0] != digests[1]


def test_later_ridges_are_higher_and_correct_ones_are_green():
    curves = np.zeros((2, 3))
    curves[1] = [0.0, 1.0, 0.5]
    predictions = StepPredictions(GRID, curves, np.array([0.2, 0.9]), np.zeros(2), duration=2.0)
    chunks = list(success_plots.ridge(predictions, np.array([-1.0, 0.5]), last=1, success=True))
    ridge = next(chunk for chunk in chunks if chunk.entity_path == "/ridge/curves").to_record_batch().to_pydict()
    strips, colours = ridge["LineStrips2D:strips"][0], ridge["LineStrips2D:colors"][0]
    np.testing.assert_allclose(strips[0], [[-1, 0], [0, 0], [1, 0]])
    np.testing.assert_allclose(strips[1], [[-1, -5.0], [0, -5.4], [1, -5.2]], atol=1e-6)
    red, green = (int.from_bytes([*colour, 255]) for colour in (success_plots.WRONG, success_plots.RIGHT))
    assert colours == [red, green, *[int.from_bytes([*success_plots.TICK, 255])] * 2]
    np.testing.assert_allclose(strips[3], [[0.5, -5.0], [0.5, -5.2]], atol=1e-6)


def test_expert_actions_in_the_states_of_an_experts_episode_are_its_actions():
    (_, episode), *_ = rollout(ExpertAgent(), SOURCE, [CASE], threads=1)
    np.testing.assert_array_equal(expert_actions(CASE.expert, episode.states[:-1]), episode.actions[:, 0])


def test_contacts_are_close_to_the_bottle():
    (_, episode), *_ = rollout(ExpertAgent(), SOURCE, [Case(SETTINGS[0], Expert(1.4, 0.17), 0.1)], threads=1)
    _, _, contacts = scene.poses(episode.states)
    assert not len(contacts[0])
    points = np.concatenate(contacts)
    bottle = np.repeat(episode.states[:, :3], [len(part) for part in contacts], axis=0)
    assert len(points)
    assert np.linalg.norm(points[:, :2] - bottle[:, :2], axis=1).max() < 0.15
