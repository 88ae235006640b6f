"""Writes films of episodes, rendered off screen: MP4 with PyAV, GIF with Pillow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dextron_bench.errors import BadInput, Failed
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import model, task
from dextron_bench.world.rendering import renderer

RATES = {".mp4": 1.0 / model.CONTROL_STEP, ".gif": 25.0}  # [1/s] highest frame rates; many viewers slow faster GIFs.
TICK = 10  # [ms] unit of the durations in a GIF.
SIZES = (16, 2160)  # [pixels] range of width and height.
SPEEDS = (0.02, 50.0)
FOLLOW = "follow"  # A camera near the hand that moves with it.
QUALITY = "18"  # Constant rate factor of x264: a lower value gives a better and larger film.


Draw = Callable[[np.ndarray, int], np.ndarray]


def unchanged(frame: np.ndarray, index: int) -> np.ndarray:
    """The frame itself."""
    return frame


@dataclass(frozen=True, slots=True)
class FilmStyle:
    """Size [pixels], camera and speed of a film; at speed 1 it plays in real time.

    With `overlay`, numbers of the episode stand in the picture. Raises BadInput, UnknownCamera.
    """

    width: int = 640
    height: int = 480
    camera: str = "side"
    speed: float = 1.0
    overlay: bool = True

    def __post_init__(self) -> None:
        for name, size in (("width", self.width), ("height", self.height)):
            if size % 2 or not SIZES[0] <= size <= SIZES[1]:
                raise BadInput(f"{name} {size}: choose an even number of pixels from {SIZES[0]} to {SIZES[1]}")
        if not SPEEDS[0] <= self.speed <= SPEEDS[1]:
            raise BadInput(f"speed {self.speed:g}: choose a factor from {SPEEDS[0]:g} to {SPEEDS[1]:g}; 1 is real time")
        if self.camera not in (*renderer.CAMERAS, FOLLOW):
            raise renderer.UnknownCamera(self.camera, FOLLOW)

    def camera_of(self, state: np.ndarray) -> renderer.Camera:
        """The camera for a state (48,)."""
        if self.camera != FOLLOW:
            return renderer.CAMERAS[self.camera]
        x, y, z = task.palm_centre(state[None])[0].tolist()
        return replace(renderer.CAMERAS["side"], distance=0.45, target=(x, y, z))


def shown_steps(count: int, rate: float, speed: float) -> tuple[list[int], float]:
    """Indices of the states that a film of `count` states shows, always with the last, and its frame rate [1/s].

    The frame rate is `rate` at most.
    """
    stride = max(1.0, speed / model.CONTROL_STEP / rate)
    shown = [int(k * stride + 1e-9) for k in range(int((count - 1) / stride + 1e-9) + 1)]
    return [*shown, *([count - 1] if shown[-1] != count - 1 else [])], speed / model.CONTROL_STEP / stride


def mp4(
    file: Path, states: np.ndarray, style: FilmStyle, progress: Progress = no_progress, draw: Draw = unchanged
) -> None:
    """Writes states (T, 48) as H.264 in MP4, whatever the file's suffix; raises Failed, NoGraphics.

    `draw` gets each frame with the index of its state, and returns the frame to write.
    """
    av = _encoder()
    shown, rate = shown_steps(len(states), RATES[".mp4"], style.speed)
    with av.open(str(file), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", Fraction(rate).limit_denominator(1000), {"crf": QUALITY})
        stream.width, stream.height, stream.pix_fmt = style.width, style.height, "yuv420p"
        for frame in _frames(states, shown, style, draw, progress):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, "rgb24")))
        container.mux(stream.encode())  # Writes the frames that the encoder still holds.


def gif(
    file: Path, states: np.ndarray, style: FilmStyle, progress: Progress = no_progress, draw: Draw = unchanged
) -> None:
    """Like `mp4`, as a looping GIF with one palette; raises NoGraphics."""
    shown, rate = shown_steps(len(states), RATES[".gif"], style.speed)
    ends = np.rint(1000.0 / rate / TICK * np.arange(len(shown) + 1)) * TICK
    palette = _palette(states, style, draw)
    images = (
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in _frames(states, shown, style, draw, progress)
    )
    first = next(images)
    durations = np.diff(ends).astype(int).tolist()
    first.save(file, "GIF", save_all=True, append_images=images, duration=durations, loop=0)


def _frames(
    states: np.ndarray, shown: Sequence[int], style: FilmStyle, draw: Draw = unchanged, progress: Progress = no_progress
) -> Iterator[np.ndarray]:
    with renderer.Renderer(style.width, style.height, supersampling=1) as frame_renderer:
        for done, index in enumerate(shown, start=1):
            yield draw(frame_renderer.render(states[index], style.camera_of(states[index])), index)
            progress(done, len(shown))


def _palette(states: np.ndarray, style: FilmStyle, draw: Draw) -> Image.Image:
    """An image with the palette of the first, the middle and the last frame."""
    some = [0, len(states) // 2, len(states) - 1]
    return Image.fromarray(np.concatenate([*_frames(states, some, style, draw)])).quantize(
        256, dither=Image.Dither.NONE
    )


def _encoder() -> Any:
    try:
        import av
    except ImportError as error:
        raise Failed("MP4 needs PyAV: `pip install av`; or write a .gif") from error
    return av
