"""Experts that are played together have exactly the outcomes of experts played alone."""

import numpy as np
import pytest

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import branching, policies
from dextron_bench.experts.policies import Expert, ExpertAgent
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.world.engine import Engine

SOURCE = MinjerkSource()
CRITICALS = np.array([0.12, 0.95, 0.30, 0.12, 0.02])


def play(numbers: range, criticals: np.ndarray, slots: int, threads: int = 1) -> list[branching.Outcomes]:
    """The outcomes of batches on minjerk reaches, in the order of their numbers."""
    settings = [SOURCE.sample(np.random.default_rng(number)) for number in numbers]
    batches = [branching.ExpertBatch(SOURCE.path(one), 2.0, criticals) for one in settings]
    outcomes = dict(branching.play(Engine(slots, threads), batches))
    return [outcomes[number] for number in sorted(outcomes)]


@pytest.fixture(scope="module")
def alone() -> tuple[np.ndarray, np.ndarray]:
    """Returns and lengths (2, 5) of the same experts played one by one."""
    settings = [SOURCE.sample(np.random.default_rng(number)) for number in range(2)]
    cases = [policies.Case(one, Expert(2.0, float(critical)), 0.0) for one in settings for critical in CRITICALS]
    played = dict(rollout(ExpertAgent(), SOURCE, cases, threads=1))
    scores = np.array([played[i].score for i in range(len(cases))])
    lengths = np.array([len(played[i].actions) for i in range(len(cases))])
    return scores.reshape(2, -1), lengths.reshape(2, -1)


@pytest.mark.slow
@pytest.mark.parametrize(("slots", "threads"), [(5, 1), (7, 2), (64, 2)])
def test_experts_played_together_and_one_by_one_have_equal_outcomes(alone, slots, threads):
    outcomes = play(range(2), CRITICALS, slots, threads)
    np.testing.assert_array_equal([batch.returns for batch in outcomes], alone[0])
    np.testing.assert_array_equal([batch.lengths for batch in outcomes], alone[1])


def test_outcomes_differ_between_experts(alone):
    # The comparison above needs this: closing at 0.12 grasps the bottle, closing at once does not.
    scores = alone[0]
    assert scores[0, 0] > 1
    assert scores[0, 1] == 0


def test_equal_experts_have_equal_outcomes(alone):
    np.testing.assert_array_equal(alone[0][:, 0], alone[0][:, 3])


def test_more_experts_than_slots_are_refused():
    with pytest.raises(ValueError, match="5 experts need as many slots; there are 4"):
        play(range(1), CRITICALS, slots=4)
