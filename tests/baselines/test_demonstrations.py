"""Demonstrations: rows in order, streams of whole episodes, and equal arrays from the cache."""

from pathlib import Path

import numpy as np

from baselines import demonstrations
from baselines.demonstrations import Demonstrations
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.methods.learners import TrainingSetup
from tests.helpers.short_reaches import SETTINGS, SOURCE

CASES = [Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS[:3]]

# Two episodes of two and three steps: rows 0, 1, (2) and 3, 4, 5, (6).
TWO_EPISODES = Demonstrations(np.zeros((7, 48), np.float32), np.arange(7.0), np.zeros(7), np.array([0, 3, 7]))


def test_transitions_leave_out_last_states():
    assert TWO_EPISODES.transitions().tolist() == [0, 1, 3, 4, 5]


def test_a_stream_has_whole_episodes_and_the_given_length():
    stream = TWO_EPISODES.stream(np.random.default_rng(0), 200)
    text = "".join(map(str, stream.tolist()))
    assert len(text) == 200
    assert not text.replace("345", "").replace("01", "").strip("034")
    assert 15 < text.count("01") < 65
    np.testing.assert_array_equal(stream[:50], TWO_EPISODES.stream(np.random.default_rng(0), 50))


def test_demonstrations_equal_the_rollouts_of_experts_and_are_cached(tmp_path: Path):
    reported: list[tuple[int, int]] = []
    setup = TrainingSetup(SOURCE, CASES, tmp_path, 1, report=lambda done, total, note: reported.append((done, total)))
    demos = demonstrations.load(setup)
    assert reported == [(1, 3), (2, 3), (3, 3)]
    played = dict(rollout(ExpertAgent(), SOURCE, CASES, threads=1))
    for k in range(3):
        rows = slice(demos.starts[k], demos.starts[k + 1])
        np.testing.assert_array_equal(demos.states[rows], played[k].states.astype(np.float32))
        np.testing.assert_array_equal(demos.actions[rows][:-1], played[k].actions[:, 0].astype(np.float32))
        np.testing.assert_array_equal(demos.rewards[rows][:-1], played[k].rewards.astype(np.float32))
    (file,) = tmp_path.iterdir()
    written = file.stat().st_mtime_ns
    again = demonstrations.load(setup)
    assert file.stat().st_mtime_ns == written
    np.testing.assert_array_equal(again.states, demos.states)
    assert len(demonstrations.load(setup, episodes=2)) == 2
    assert len(list(tmp_path.iterdir())) == 2
