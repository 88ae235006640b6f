"""Arguments of the Gymnasium environments: limits, counts, seeds, settings; errors say what is valid."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

import dextron_bench  # noqa: F401  # Registers the environments.
from dextron_bench.reaches.setting import Setting, plain
from dextron_bench.world.engine import DIVERGED
from tests.helpers.short_reaches import SETTINGS, SOURCE, TornSource, actions, played

ID = "dextron_bench/Grasp-v0"


@pytest.mark.parametrize("mode", ["vector_entry_point", "sync"])
def test_a_limit_of_steps_truncates_alike_in_every_form(mode: str):
    env = gymnasium.make_vec(ID, 2, vectorization_mode=mode, max_episode_steps=3, reaches=SOURCE)
    env.reset(seed=0)
    truncated = [env.step(np.zeros((2, 1)))[3].tolist() for _ in range(8)]
    no, yes = [False, False], [True, True]
    assert truncated == [no, no, yes, no, no, no, yes, no]  # A step of each period begins the next episode.
    env.close()


@pytest.mark.parametrize("limit", [None, -1])
def test_without_a_limit_the_task_alone_truncates(limit: int | None):
    env = gymnasium.make_vec(ID, 1, reaches=SOURCE, settings=SETTINGS[:1], max_episode_steps=limit)
    env.reset()
    length = len(played(0).rewards)
    ends = [env.step(actions(0)[t][None])[2:4] for t in range(length)]
    assert [bool((a | b)[0]) for a, b in ends] == [False] * (length - 1) + [True]


@pytest.mark.parametrize("limit", [0, -2, 1.5, "3"])
def test_a_limit_that_is_no_count_is_refused(limit: Any):
    with pytest.raises(ValueError, match="max_episode_steps must be an integer of at least 1, -1 or None; got"):
        gymnasium.make_vec(ID, 1, reaches=SOURCE, max_episode_steps=limit)


@pytest.mark.slow
def test_the_limit_of_the_registration_changes_no_episode():
    """At 500, Gymnasium's TimeLimit would also truncate an episode that terminates in that very step."""

    class TornLast(TornSource):
        """A source whose hand rests until the simulation diverges in step 500."""

        def path(self, setting: Setting) -> Any:
            path = super().path(SETTINGS[0])
            positions, quaternions = (np.tile(rows[:1], (501, 1)) for rows in (path.positions, path.quaternions))
            positions[500] = np.nan
            return replace(path, positions=positions, quaternions=quaternions)

    single, vector = gymnasium.make(ID, reaches=TornLast()), gymnasium.make_vec(ID, 1, reaches=TornLast())
    assert single.spec is not None
    assert single.spec.max_episode_steps == 501
    single.reset(seed=0)
    vector.reset(seed=0)
    ends = [single.step(np.zeros(1))[2:4] for _ in range(500)]
    assert ends == [(False, False)] * 499 + [(True, False)]
    steps = [vector.step(np.zeros((1, 1))) for _ in range(500)]
    assert [(bool(a[0]), bool(b[0])) for _, _, a, b, _ in steps] == ends
    assert steps[-1][-1]["failure"].tolist() == [DIVERGED]


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_arguments_of_another_form_are_refused_with_the_valid_ones(make: Callable[..., Any]):
    cases = [
        ({"reaches": None}, TypeError, "must be a source of reaches or its name"),
        ({"settings": SETTINGS[0]}, ValueError, "must be a list of settings"),
        ({"settings": plain(SETTINGS[0])}, ValueError, "must be a list of settings"),
        ({"settings": iter(())}, ValueError, "empty list"),
        ({"settings": np.array([])}, ValueError, "empty list"),
        ({"render_mode": "ansi"}, ValueError, "no render mode 'ansi'; choose from rgb_array"),
    ]
    warnings.simplefilter("ignore")  # Gymnasium warns of the render mode before.
    for arguments, error, message in cases:
        with pytest.raises(error, match=message):
            make(ID, **({"reaches": SOURCE} | arguments))


@pytest.mark.parametrize("count", [0, -1, 1.5, "2"])
def test_a_number_of_slots_below_one_is_refused(count: Any):
    with pytest.raises(ValueError, match="num_envs must be an integer of at least 1; got"):
        gymnasium.make_vec(ID, count, reaches=SOURCE)


@pytest.mark.parametrize("seed", [2**70, np.uint64(2**63), np.int32(3)])
def test_seeds_of_every_size_repeat_episodes(seed: Any):
    for env in (gymnasium.make(ID, reaches=SOURCE), gymnasium.make_vec(ID, 2, reaches=SOURCE)):
        first = env.reset(seed=seed)[0]
        env.reset()
        assert first.tobytes() == env.reset(seed=seed)[0].tobytes()


def test_the_settings_of_an_info_are_settings_of_a_reset_and_of_an_environment():
    env = gymnasium.make(ID, reaches=SOURCE)
    state, info = env.reset(seed=5)
    assert env.reset(options={"setting": info["setting"]})[0].tobytes() == state.tobytes()
    again = gymnasium.make(ID, reaches=SOURCE, settings=[info["setting"]])
    assert again.reset()[0].tobytes() == state.tobytes()
