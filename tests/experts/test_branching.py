"""Experts that share an opening must fare exactly as if each had played alone."""

import numpy as np
import pytest

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import branching, policies
from dextron_bench.experts.policies import Expert, ExpertAgent
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.world.engine import Engine

SOURCE = MinjerkSource()
CRITICALS = np.array([0.12, 0.95, 0.30, 0.12, 0.02])


def ask(numbers: range, criticals: np.ndarray, slots: int, threads: int = 1) -> list[branching.Outcomes]:
    """Answers for that many minjerk reaches, in order."""
    settings = [SOURCE.sample(np.random.default_rng(number)) for number in numbers]
    batches = [branching.ExpertBatch(SOURCE.path(each), 2.0, criticals) for each in settings]
    outcomes = dict(branching.play(Engine(slots, threads), batches))
    return [outcomes[number] for number in sorted(outcomes)]


@pytest.fixture(scope="module")
def alone() -> tuple[np.ndarray, np.ndarray]:
    """Returns and lengths (2, 5) of the same experts played one by one."""
    settings = [SOURCE.sample(np.random.default_rng(number)) for number in range(2)]
    cases = [policies.Case(each, Expert(2.0, float(critical)), 0.0) for each in settings for critical in CRITICALS]
    played = dict(rollout(ExpertAgent(), SOURCE, cases, threads=1))
    scores = np.array([played[i].score for i in range(len(cases))])
    lengths = np.array([len(played[i].actions) for i in range(len(cases))])
    return scores.reshape(2, -1), lengths.reshape(2, -1)


@pytest.mark.parametrize(("slots", "threads"), [(5, 1), (7, 2), (64, 2)])
def test_shared_openings_end_as_experts_played_one_by_one(alone, slots, threads):
    outcomes = ask(range(2), CRITICALS, slots, threads)
    np.testing.assert_array_equal([each.returns for each in outcomes], alone[0])
    np.testing.assert_array_equal([each.lengths for each in outcomes], alone[1])


def test_outcomes_differ_between_experts(alone):
    # Else the comparison above would prove nothing: closing at 0.12 grasps, closing at once does not.
    scores = alone[0]
    assert scores[0, 0] > 1
    assert scores[0, 1] == 0


def test_equal_experts_fare_equally(alone):
    np.testing.assert_array_equal(alone[0][:, 0], alone[0][:, 3])


def test_more_experts_than_slots_are_refused():
    with pytest.raises(ValueError, match="5 experts need as many slots; there are 4"):
        ask(range(1), CRITICALS, slots=4)
