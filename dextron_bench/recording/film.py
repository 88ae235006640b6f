"""Films of episodes, rendered off screen: MP4 by PyAV, and GIF by Pillow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dextron_bench.world import model
from dextron_bench.world.rendering import renderer

RATES = {".mp4": 1.0 / model.CONTROL_STEP, ".gif": 25.0}  # [1/s] pictures at most; many viewers slow quicker GIFs down.
TICK = 10  # [ms] in which a GIF counts.
SIZES = (16, 2160)  # [pixels] a side.
SPEEDS = (0.02, 50.0)
QUALITY = "18"  # Constant rate factor of x264: less is better, and larger.

Report = Callable[[int, int], None]  # Told (pictures drawn, all).


class BadFilmStyle(ValueError):
    """A film that cannot be made so."""


class NoEncoder(RuntimeError):
    """No way to write MP4."""


@dataclass(frozen=True, slots=True)
class FilmStyle:
    """How a film looks: its size [pixels], whence it is seen, and how many times as quick as life.

    Raises BadFilmStyle, UnknownCamera.
    """

    width: int = 640
    height: int = 480
    camera: str = "side"
    speed: float = 1.0

    def __post_init__(self) -> None:
        for name, size in (("width", self.width), ("height", self.height)):
            if size % 2 or not SIZES[0] <= size <= SIZES[1]:
                raise BadFilmStyle(
                    f"{name} {size}: films have an even number of pixels from {SIZES[0]} to {SIZES[1]} a side"
                )
        if not SPEEDS[0] <= self.speed <= SPEEDS[1]:
            raise BadFilmStyle(f"speed {self.speed:g}: choose from {SPEEDS[0]:g} to {SPEEDS[1]:g} times life's")
        if self.camera not in renderer.CAMERAS:
            raise renderer.UnknownCamera(self.camera)


def shown_steps(count: int, rate: float, speed: float) -> tuple[list[int], float]:
    """Which of `count` states a film shows, the last one always, and how many a second [1/s], `rate` at most."""
    stride = max(1.0, speed / model.CONTROL_STEP / rate)
    shown = [int(k * stride + 1e-9) for k in range(int((count - 1) / stride + 1e-9) + 1)]
    return [*shown, *([count - 1] if shown[-1] != count - 1 else [])], speed / model.CONTROL_STEP / stride


def mp4(file: Path, states: np.ndarray, look: FilmStyle, report: Report) -> None:
    """Writes states (T, 48) as H.264 to `file`, whatever it is called; raises NoEncoder, NoGraphics."""
    av = _encoder()
    shown, rate = shown_steps(len(states), RATES[".mp4"], look.speed)
    with av.open(str(file), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", Fraction(rate).limit_denominator(1000), {"crf": QUALITY})
        stream.width, stream.height, stream.pix_fmt = look.width, look.height, "yuv420p"
        for picture in _pictures(states[shown], look, report):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, "rgb24")))
        container.mux(stream.encode())  # What it still holds back.


def gif(file: Path, states: np.ndarray, look: FilmStyle, report: Report) -> None:
    """Writes states (T, 48) as an endless GIF of one palette to `file`, whatever it is called; raises NoGraphics."""
    shown, rate = shown_steps(len(states), RATES[".gif"], look.speed)
    ends = np.rint(1000.0 / rate / TICK * np.arange(len(shown) + 1)) * TICK
    palette = _palette(states[[0, len(states) // 2, -1]], look)
    drawn = (
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in _pictures(states[shown], look, report)
    )
    first = next(drawn)
    durations = np.diff(ends).astype(int).tolist()
    first.save(file, "GIF", save_all=True, append_images=drawn, duration=durations, loop=0)


def _pictures(states: np.ndarray, look: FilmStyle, report: Report = lambda done, total: None) -> Iterator[np.ndarray]:
    with renderer.Painter(look.width, look.height, supersampling=1) as painter:
        for done, state in enumerate(states, start=1):
            yield painter.paint(state, renderer.CAMERAS[look.camera])
            report(done, len(states))


def _palette(states: np.ndarray, look: FilmStyle) -> Image.Image:
    """The colours of some states' pictures."""
    return Image.fromarray(np.concatenate(list(_pictures(states, look)))).quantize(256, dither=Image.Dither.NONE)


def _encoder() -> Any:
    try:
        import av
    except ImportError as error:
        raise NoEncoder("MP4 needs PyAV: `pip install av`; or write a .gif") from error
    return av
