"""Pictures show the state and nothing else, and errors say what to install."""

from __future__ import annotations

import numpy as np
import pytest

from dextron_bench.world import model
from dextron_bench.world.rendering import context, renderer


@pytest.fixture(scope="module")
def start() -> np.ndarray:
    """The state (48,) with the hand half closed, beside the bottle."""
    return np.concatenate([model.initial_qpos(), np.zeros(23)])


def orange(picture: np.ndarray) -> int:
    """Pixels of the bottle's colour."""
    red, green, blue = np.moveaxis(picture.astype(int), -1, 0)
    return int(((red > 120) & (red > 2 * green) & (red > 3 * blue)).sum())


def test_a_picture_shows_the_bottle_at_its_position(start: np.ndarray) -> None:
    away = start.copy()
    away[model.BOTTLE_POSITION] = 9.0
    both = renderer.frames(np.stack([start, away]), 160, 120)
    assert both.shape == (2, 120, 160, 3)
    assert both.dtype == np.uint8
    assert orange(both[0]) > 60
    assert orange(both[1]) == 0


def test_the_sky_is_at_the_top(start: np.ndarray) -> None:
    picture = renderer.render(start, 80, 60).astype(int)
    assert picture[:5].mean() > picture[-5:].mean() + 20


def test_a_picture_depends_only_on_its_state(start: np.ndarray) -> None:
    lifted = start.copy()
    lifted[2] += 0.2
    pictures = renderer.frames(np.stack([lifted, start, lifted]), 80, 60)
    np.testing.assert_array_equal(pictures[0], pictures[2])
    assert (pictures[0] != pictures[1]).any()


@pytest.mark.slow
def test_more_lights_soften_shadows(start: np.ndarray) -> None:
    hard, soft = (renderer.render(start, 160, 120, "top", lights).astype(int) for lights in (1, 6))
    steps = [np.abs(np.diff(picture.sum(axis=2), axis=0)).max() for picture in (hard, soft)]
    assert (hard != soft).any()
    assert steps[1] <= steps[0]


def test_the_error_for_an_unknown_camera_lists_the_cameras(start: np.ndarray) -> None:
    with pytest.raises(
        renderer.UnknownCamera, match="no camera 'left'; choose from behind, front, hand, hero, side, top"
    ):
        renderer.render(start, camera="left")


def test_without_graphics_the_error_says_what_to_install(start: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(context, "find_library", lambda name: None)
    with pytest.raises(renderer.NoGraphics, match=r"libegl1 .*libosmesa6"):
        renderer.render(start)
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    with pytest.raises(renderer.NoGraphics, match="MUJOCO_GL='disabled'"):
        renderer.render(start)


@pytest.mark.parametrize("size", [(0, 10), (-1, 5), (1.5, 5), (8, 10_000)])
def test_a_size_that_no_picture_has_is_refused(size: tuple[int, int], start: np.ndarray) -> None:
    with pytest.raises(ValueError, match="has 1 to 4096 pixels along each side; got"):
        renderer.render(start, *size)
