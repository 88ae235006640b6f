"""The evaluation loop: every case is played once for any number of slots, and a fault fails one episode only."""

import numpy as np
import pytest

from dextron_bench.evaluation.episodes import Episode, fingerprint
from dextron_bench.evaluation.rollout import describe_fault, rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.methods.agents import AgentError
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.reaches.setting import Setting
from tests.helpers.short_reaches import SETTINGS, TORN, TORN_POSE, TornSource
from tests.helpers.short_reaches import SOURCE as SHORT

SOURCE = MinjerkSource()
CASES = [Case(Setting(SOURCE.names[i], 0.0, 0.0, 0.0), Expert(2.0, d_c), 0.0) for i, d_c in enumerate([0.15, 0.9, 0.1])]


class Sends:
    """Sends one value, or the value of a function of the number of calls, to every episode."""

    def __init__(self, value):
        self.value, self.calls, self.resets = value, -1, []

    def reset(self, episodes):
        self.resets.append(episodes.tolist())

    def act(self, states) -> np.ndarray:
        self.calls += 1
        value = self.value(self.calls) if callable(self.value) else self.value
        return np.full((len(states), 1), value)


def play(agent, cases=CASES, **options) -> dict[int, Episode]:
    return dict(rollout(agent, SOURCE, cases, threads=1, **options))


@pytest.mark.slow
def test_every_case_is_played_once_and_equally_for_any_number_of_slots():
    one, all_at_once = play(ExpertAgent(), slots=1), play(ExpertAgent(), slots=3)
    assert sorted(one) == sorted(all_at_once) == [0, 1, 2]
    for index, episode in one.items():
        other = all_at_once[index]
        assert episode.setting == CASES[index].setting
        np.testing.assert_array_equal(episode.states, other.states)
        np.testing.assert_array_equal(episode.actions, other.actions)
        np.testing.assert_array_equal(episode.rewards, other.rewards)


def test_the_shapes_and_the_end_of_an_episode():
    episode = play(Sends(0.0))[0]
    steps = len(episode.rewards)
    assert episode.states.shape == (steps + 1, 48)
    assert episode.actions.shape == (steps, 1)
    assert episode.terminated != episode.truncated
    assert episode.failure == ""


def test_reset_names_the_rows_that_begin():
    agent = Sends(0.0)
    play(agent, slots=2)
    assert agent.resets[0] == [0, 1]
    assert len(agent.resets) == 2
    assert agent.resets[1] in ([0], [1])


@pytest.mark.parametrize(
    ("value", "reason"),
    [(np.nan, "action is nan at step 0"), (np.inf, "action is inf at step 0"), (1.5, "action 1.5 is outside [-1, 1]")],
)
def test_an_invalid_action_fails_the_episode_and_is_named(value, reason):
    episodes = play(Sends(value))
    assert all(episode.failure.startswith(reason) for episode in episodes.values())
    assert [episode.score for episode in episodes.values()] == [0.0, 0.0, 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("slots", [1, 2, 3])
def test_a_simulation_that_diverges_fails_its_episode_and_is_named(slots):
    """MuJoCo resets such a simulation by itself; the episode continued with the bottle and hand at their origins."""
    cases = [Case(setting, Expert(2.0, 0.15), 0.0) for setting in (SETTINGS[0], TORN, SETTINGS[4])]
    episodes = dict(rollout(ExpertAgent(), TornSource(), cases, slots, threads=1))
    assert sorted(episodes) == [0, 1, 2]
    torn = episodes[1]
    assert torn.failure == f"the simulation diverged at step {TORN_POSE - 1}"
    assert (torn.score, torn.success, torn.terminated, torn.truncated) == (0.0, False, False, False)
    assert torn.states.shape == (TORN_POSE, 48)
    assert torn.actions.shape == (TORN_POSE - 1, 1)
    assert np.isfinite(torn.states).all()
    for index, case in ((0, cases[0]), (2, cases[2])):
        alone = dict(rollout(ExpertAgent(), SHORT, [case], threads=1))[0]
        assert episodes[index].states.tobytes() == alone.states.tobytes()
        assert (episodes[index].failure, episodes[index].score) == ("", alone.score)


@pytest.mark.slow
def test_a_fault_does_not_change_other_episodes():
    class FailsInRow1(ExpertAgent):
        def act(self, states):
            actions = super().act(states)
            actions[1] = np.nan
            return actions

    failed, expected = play(FailsInRow1()), play(ExpertAgent())
    assert failed[1].failure
    for index in (0, 2):
        np.testing.assert_array_equal(failed[index].states, expected[index].states)


def test_a_fault_in_a_later_step_names_the_step():
    episode = play(Sends(lambda call: 0.0 if call < 3 else -2.0), CASES[:1])[0]
    assert episode.failure == "action -2.0 is outside [-1, 1] at step 3"
    assert len(episode.actions) == 3


@pytest.mark.slow
@pytest.mark.parametrize("value", [np.nextafter(1.0, 2.0), 1.0 + 1e-6, np.float32(1.0000001), -1.0 - 1e-6])
def test_an_action_that_rounding_put_outside_the_range_is_clipped_and_stored_clipped(value):
    """RescaleAction of Gymnasium ends at 1.0000000000000002 for a third of all ranges."""
    clipped, expected = play(Sends(value), CASES[:1])[0], play(Sends(np.sign(value)), CASES[:1])[0]
    assert clipped.failure == ""
    assert set(clipped.actions.ravel()) == {np.sign(value)}
    assert fingerprint(clipped) == fingerprint(expected)


def test_actions_of_the_wrong_shape_end_the_evaluation():
    class Flat(Sends):
        def act(self, states):
            return np.zeros(len(states))

    with pytest.raises(AgentError, match=r"must return floats of shape \(3, 1\).*it returned float64 of shape \(3,\)"):
        play(Flat(0.0))


def test_the_agent_cannot_change_the_recorded_states():
    class ChangesStates(Sends):
        def act(self, states):
            states[:] = 7.0
            return super().act(states)

    np.testing.assert_array_equal(play(ChangesStates(0.0))[0].states, play(Sends(0.0))[0].states)


def test_no_cases_give_no_episodes():
    assert play(Sends(0.0), []) == {}


def test_descriptions_of_faults():
    assert describe_fault(-1.01) == "action -1.01 is outside [-1, 1]"
    assert describe_fault(np.float64(1.0000020001)) == "action 1.0000020001 is outside [-1, 1]"  # Not rounded to 1.
    assert describe_fault(-np.inf) == "action is -inf"


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"source": "minjerk"}, TypeError, "must be a source of reaches, as open_source"),
        ({"rows": [CASES[0].setting]}, TypeError, "rows must be a split, or have the type Case"),
        ({"slots": 0}, ValueError, "slots must be an integer of at least 1; got 0"),
        ({"slots": 1.5}, ValueError, "slots must be an integer of at least 1; got 1.5"),
        ({"threads": "2"}, TypeError, "threads must be an integer, 0 for one per processor; got '2'"),
    ],
)
def test_arguments_of_another_form_are_refused_before_the_first_episode(arguments, error, message):
    with pytest.raises(error, match=message):
        rollout(Sends(0.0), **({"source": SOURCE, "rows": CASES} | arguments))


def test_cases_may_come_from_a_generator():
    assert sorted(dict(rollout(Sends(0.0), SOURCE, (case for case in CASES), threads=1))) == [0, 1, 2]
