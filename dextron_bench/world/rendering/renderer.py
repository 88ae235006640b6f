"""Renders pictures of states off screen."""

from __future__ import annotations

import atexit
import ctypes
import os
import threading
import weakref
from dataclasses import dataclass
from numbers import Integral
from types import TracebackType
from typing import Self

import numpy as np

from dextron_bench.errors import NotFound
from dextron_bench.world.rendering import visuals
from dextron_bench.world.rendering.context import INSTALL, Context, NoGraphics, create_context, refuse_fork
from dextron_bench.world.simulator import mujoco

LARGEST = 4096  # [px] width and height of a picture.
SUPERSAMPLING = 2  # Rendered pixels along each side of a pixel of the picture.
LIGHT_RADIUS = 0.35  # [m] radius of the lamp that casts soft shadows.


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera that looks at a target point [m] from a distance [m]; azimuth and elevation in degrees, as in MuJoCo."""

    azimuth: float
    elevation: float
    distance: float
    target: tuple[float, float, float]


CAMERAS = {
    "side": Camera(150, -12, 1.0, (-0.06, -0.06, 0.18)),
    "front": Camera(-100, -12, 1.0, (-0.06, -0.06, 0.18)),
    "behind": Camera(35, -20, 1.1, (-0.06, -0.06, 0.18)),
    "top": Camera(90, -75, 1.0, (-0.08, -0.1, 0.12)),
    "hand": Camera(200, -18, 0.36, (-0.03, -0.01, 0.275)),
    "hero": Camera(160, -17, 0.66, (-0.02, -0.05, 0.21)),
}


class UnknownCamera(NotFound):
    """No camera has that name; the message lists the names."""

    def __init__(self, name: str, *others: str) -> None:
        super().__init__(f"no camera {name!r}; choose from {', '.join(sorted((*CAMERAS, *others)))}")

    def __str__(self) -> str:
        return str(self.args[0])


def render(state: np.ndarray, width: int = 640, height: int = 480, camera: str = "side", lights: int = 1) -> np.ndarray:
    """A picture, RGB (height, width, 3) uint8, of a state (48,). More `lights` make shadows softer.

    Raises NoGraphics and UnknownCamera.
    """
    return frames(state[None], width, height, camera, lights)[0]


def frames(
    states: np.ndarray, width: int = 640, height: int = 480, camera: str = "side", lights: int = 1
) -> np.ndarray:
    """Pictures (T, height, width, 3) uint8 of states (T, 48). Raises the errors of `render`."""
    if camera not in CAMERAS:
        raise UnknownCamera(camera)
    with Renderer(width, height) as renderer:
        return np.stack([renderer.render(state, CAMERAS[camera], lights) for state in states])


class Renderer:
    """Renders pictures of one size off screen, in the thread that made it.

    `close`, or the end of a `with` statement, frees its memory. Several may draw in turn.
    """

    def __init__(self, width: int, height: int, supersampling: int = SUPERSAMPLING) -> None:
        """Takes the size of the pictures [pixels] and the supersampling along each side.

        Raises NoGraphics and ValueError.
        """
        for size in (width, height):
            if not isinstance(size, Integral) or not 1 <= size <= LARGEST:
                raise ValueError(f"a picture has 1 to {LARGEST} pixels along each side; got {width!r} x {height!r}")
        self._supersampling = supersampling
        self._size = width, height = width * supersampling, height * supersampling
        self._model = visuals.visual_model()
        self._data = mujoco.MjData(self._model)
        self._context = create_context(width, height)
        try:
            self._graphics = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except mujoco.FatalError as error:
            raise NoGraphics(f"cannot draw off screen: {error}; {INSTALL}") from error
        mujoco.mjr_resizeOffscreen(width, height, self._graphics)  # A larger buffer costs time in every picture.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._graphics)
        self._scene = mujoco.MjvScene(self._model, maxgeom=1000)
        self._option = mujoco.MjvOption()
        self._home = _here()
        self._free = weakref.finalize(self, _free, self._home, self._context, self._graphics)
        self._free.atexit = False  # It would come after the end of EGL, which Python ends in the reverse order.
        atexit.register(self._free)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    @property
    def is_in_other_thread(self) -> bool:
        """True in a thread that did not make it, and cannot draw with it."""
        return self._home[1] != _here()[1]

    def close(self) -> None:
        """Frees the memory; it draws nothing more."""
        self._free()
        atexit.unregister(self._free)

    def render(self, state: np.ndarray, camera: Camera, lights: int = 1) -> np.ndarray:
        """A picture (height, width, 3) uint8 of a state (48,), averaged over `lights` positions of the key light.

        Raises NoGraphics in a process that was forked from the renderer's.
        """
        refuse_fork()
        self._context.make_current()  # Another renderer may have drawn in between.
        self._data.qpos[:] = state[: self._model.nq]
        mujoco.mj_forward(self._model, self._data)
        key = self._model.light("key").id
        centre = self._data.light_xpos[key].copy()
        total = np.zeros((self._size[1], self._size[0], 3))
        for shift in _disc(lights, LIGHT_RADIUS):
            self._data.light_xpos[key] = centre + shift
            total += self._render_once(camera)
        picture = total / lights
        n = self._supersampling
        rows = picture[::-1].reshape(self._size[1] // n, n, self._size[0] // n, n, 3)
        return np.round(rows.mean(axis=(1, 3))).astype(np.uint8)

    def _render_once(self, camera: Camera) -> np.ndarray:
        """One picture at the rendered size, bottom row first."""
        view = mujoco.MjvCamera()
        view.azimuth, view.elevation, view.distance = camera.azimuth, camera.elevation, camera.distance
        view.lookat[:] = camera.target
        categories = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, view, categories, self._scene)
        viewport = mujoco.MjrRect(0, 0, *self._size)
        mujoco.mjr_render(viewport, self._scene, self._graphics)
        pixels = np.empty((self._size[1], self._size[0], 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, viewport, self._graphics)
        return pixels


def _here() -> tuple[int, int]:
    """The process and the thread that run this."""
    return os.getpid(), threading.get_ident()


def _free(home: tuple[int, int], context: Context, graphics: mujoco.MjrContext) -> None:
    """Frees the memory of a renderer of a process and thread."""
    if home == _here():
        context.make_current()
        graphics.free()
        context.free()
        return
    for mine in (context, graphics):  # Elsewhere, even their destructors would crash: they live to the end.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(mine))


def _disc(n: int, radius: float) -> np.ndarray:
    """Points (n, 3) that cover a horizontal disc evenly; only the centre if n is 1."""
    i = np.arange(n)
    r, turn = radius * np.sqrt(i / n), i * np.pi * (3 - np.sqrt(5))
    return np.stack([r * np.cos(turn), r * np.sin(turn), np.zeros(n)], axis=1)
