"""The overlay of a film: its text, its bars, and the outcome at the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dextron_bench.recording.film_overlay import ACTION, CLOSURE, Overlay
from dextron_bench.world import model, task
from tests.recording.test_episode_file import episode

WIDTH, HEIGHT = 480, 360


def pixels(frame: np.ndarray, colour: tuple[int, int, int, int]) -> int:
    return int((np.abs(frame.astype(int) - colour[:3]).max(axis=2) <= 2).sum())


def test_the_text_has_time_distance_and_the_return_so_far():
    one = replace(episode(steps=10), rewards=np.array([0.0] * 7 + [1.0] * 3))
    overlay = Overlay(one, HEIGHT)
    distance = task.distance(one.states)[10]
    assert overlay.text(10) == f"{10 * model.CONTROL_STEP:.2f} s   distance {distance:.3f} m   return 3"
    assert overlay.text(0).endswith("return 0")


@pytest.mark.parametrize("action", [-1.0, -0.5, 0.25, 1.0])
def test_the_bar_of_an_action_is_as_long_as_the_action(action: float):
    one = replace(episode(steps=4), actions=np.full((4, 1), action))
    black = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    whole = Overlay(replace(one, actions=np.ones((4, 1))), HEIGHT).draw(black, 2)
    drawn = Overlay(one, HEIGHT).draw(black, 2)
    assert pixels(drawn, ACTION) == pytest.approx(abs(action) * pixels(whole, ACTION), rel=0.1)
    assert pixels(drawn, CLOSURE) > 0


def test_the_outcome_appears_with_the_last_state_only():
    one, grey = episode(steps=4), np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    overlay = Overlay(one, HEIGHT)
    top = slice(0, HEIGHT // 4)
    assert (overlay.draw(grey, 3)[top] == 128).all()
    assert (overlay.draw(grey, 4)[top] != 128).any()
    assert (grey == 128).all()  # The frame itself stays.
