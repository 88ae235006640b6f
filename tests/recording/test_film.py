"""Films play in real time and show their states; styles that are not possible are errors in one line."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from dextron_bench.recording import film as recording_film
from dextron_bench.recording.film import BadFilmStyle, FilmStyle, NoEncoder
from dextron_bench.world import model
from dextron_bench.world.rendering import renderer

SMALL = FilmStyle(64, 48)


def lifting(count: int) -> np.ndarray:
    """States (count, 48) in which the bottle rises."""
    states = np.tile(np.concatenate([model.initial_qpos(), np.zeros(23)]), (count, 1))
    states[:, 2] += np.linspace(0.0, 0.2, count)
    return states


def read_film(file: Path) -> tuple[list[np.ndarray], float]:
    """Frames of a film, and its duration [s]."""
    if file.suffix == ".gif":
        image, frames, duration = Image.open(file), [], 0.0
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB")))
            duration += image.info["duration"] / 1000
        return frames, duration
    with av.open(str(file)) as film:
        assert film.duration
        return [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)], film.duration / 1e6


@pytest.mark.parametrize(
    ("count", "rate", "speed", "shown", "fps"),
    [
        (5, 50.0, 1.0, [0, 1, 2, 3, 4], 50.0),
        (5, 25.0, 1.0, [0, 2, 4], 25.0),
        (6, 25.0, 1.0, [0, 2, 4, 5], 25.0),  # The last state, whatever the stride.
        (4, 25.0, 0.5, [0, 1, 2, 3], 25.0),
        (3, 50.0, 0.25, [0, 1, 2], 12.5),
        (11, 50.0, 5.0, [0, 5, 10], 50.0),
        (8, 50.0, 1.5, [0, 1, 3, 4, 6, 7], 50.0),
        (2, 50.0, 20.0, [0, 1], 50.0),
        (1, 50.0, 1.0, [0], 50.0),
    ],
)
def test_a_film_shows_these_steps_at_this_rate(count: int, rate: float, speed: float, shown: list[int], fps: float):
    assert recording_film.shown_steps(count, rate, speed) == (shown, pytest.approx(fps))


@pytest.mark.slow
@pytest.mark.parametrize(("write", "count"), [(recording_film.mp4, 26), (recording_film.gif, 14)])
def test_a_film_takes_as_long_as_the_episode_and_shows_it(tmp_path: Path, write: Callable[..., None], count: int):
    file, progress = tmp_path / f"film.{write.__name__}", []
    write(file, lifting(26), SMALL, lambda *parts: progress.append(parts))
    frames, duration = read_film(file)
    assert progress == [(k + 1, count) for k in range(count)]
    assert len(frames) == count
    assert duration == pytest.approx(0.52, abs=0.041)  # 26 states, 0.02 s each.
    expected = renderer.frames(lifting(26)[[0, -1]], 64, 48)
    for frame, still in zip((frames[0], frames[-1]), expected, strict=True):
        assert np.abs(frame.astype(int) - still).mean() < 6.0
    assert np.abs(frames[0].astype(int) - frames[-1]).mean() > 0.5


@pytest.mark.slow
def test_slow_motion_takes_longer(tmp_path: Path):
    recording_film.gif(tmp_path / "slow.gif", lifting(4), FilmStyle(64, 48, speed=0.3))
    frames, duration = read_film(tmp_path / "slow.gif")
    assert (len(frames), duration) == (4, pytest.approx(0.27))  # 4 at 15 a second; a GIF counts in 1/100 s.


@pytest.mark.parametrize(
    ("style", "message"),
    [
        ({"width": 641}, "width 641: choose an even number of pixels from 16 to 2160"),
        ({"height": 8}, "height 8: choose"),
        ({"width": 4000}, "width 4000: choose"),
        ({"speed": 0.0}, "speed 0: choose a factor from 0.02 to 50; 1 is real time"),
        ({"speed": float("nan")}, "speed nan"),
    ],
)
def test_an_impossible_style_is_refused(style: dict[str, float], message: str):
    with pytest.raises(BadFilmStyle) as caught:
        FilmStyle(**style)  # pyright: ignore[reportArgumentType]
    assert str(caught.value).startswith(message)


def test_an_unknown_camera_lists_the_cameras():
    with pytest.raises(renderer.UnknownCamera, match="no camera 'left'; choose from behind, follow, front"):
        FilmStyle(camera="left")


def test_without_an_encoder_the_error_says_how_to_install_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(NoEncoder, match=r"`pip install av`; or write a \.gif"):
        recording_film.mp4(tmp_path / "film.mp4", lifting(3), SMALL)


@pytest.mark.parametrize("write", [recording_film.mp4, recording_film.gif])
def test_without_graphics_there_is_only_the_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], write: Callable[..., None]
):
    for backend in ("disabled", "glfw"):
        monkeypatch.setenv("MUJOCO_GL", backend)
        monkeypatch.delenv("DISPLAY", raising=False)
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        with pytest.raises(renderer.NoGraphics, match="cannot draw off screen"):
            write(tmp_path / "film", lifting(3), SMALL)
    assert capfd.readouterr() == ("", "")
