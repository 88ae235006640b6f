"""Replays take actions in every form of numbers, and refuse what fits no setting."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dextron_bench.evaluation.episodes import fingerprint
from dextron_bench.evaluation.replay import replay
from dextron_bench.reaches.setting import SettingError, plain
from tests.helpers.short_reaches import SETTINGS, SOURCE, actions, played

ROUND = np.round(actions(0)[:, 0], 1)


@pytest.mark.slow
@pytest.mark.parametrize("form", [ROUND, ROUND[:, None], ROUND.tolist(), tuple(ROUND), ROUND[:, None].tolist()])
def test_actions_may_have_every_form_of_a_sequence(form: Any):
    expected, episode = (dict(replay(SOURCE, SETTINGS[:1], [sent], threads=1))[0] for sent in (ROUND, form))
    assert fingerprint(episode) == fingerprint(expected)


def test_the_actions_of_an_episode_give_its_states_again():
    episode = dict(replay(SOURCE, SETTINGS[:1], [actions(0)], threads=1))[0]
    assert episode.states.tobytes() == played(0).states.tobytes()
    again = dict(replay(SOURCE, SETTINGS[:1], [episode.actions], threads=1))[0]
    assert fingerprint(again) == fingerprint(episode)


def test_actions_that_rounding_put_outside_the_range_are_stored_clipped_and_replay_with_the_same_bits():
    beyond = np.full((500, 1), 1.0 + 1e-7)
    episode = dict(replay(SOURCE, SETTINGS[:1], [beyond], threads=1))[0]
    assert set(episode.actions.ravel()) == {1.0}
    again = dict(replay(SOURCE, SETTINGS[:1], [episode.actions], threads=1))[0]
    assert fingerprint(again) == fingerprint(episode)


@pytest.mark.parametrize("sequences", [[], [ROUND, ROUND]])
def test_each_setting_has_one_sequence(sequences: list[np.ndarray]):
    with pytest.raises(ValueError, match=r"one sequence for each of 1 settings; got \d"):
        replay(SOURCE, SETTINGS[:1], sequences)


@pytest.mark.parametrize("wrong", [np.zeros((1, 500)), 0.5, None, "x", [[0.5], [0.5, 0.5]], ["close"]])
def test_what_is_no_sequence_of_numbers_is_refused(wrong: Any):
    with pytest.raises(ValueError, match="actions of an episode must"):
        replay(SOURCE, SETTINGS[:1], [wrong])


def test_settings_may_be_those_of_an_info_and_others_are_refused():
    assert dict(replay(SOURCE, [plain(SETTINGS[0])], [ROUND], threads=1))[0].setting == SETTINGS[0]  # pyright: ignore
    with pytest.raises(SettingError, match="must be a dextron_bench Setting"):
        replay(SOURCE, [3], [ROUND])  # pyright: ignore
