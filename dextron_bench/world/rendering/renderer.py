"""Renders pictures of states off screen."""

from __future__ import annotations

import os
import warnings
from ctypes.util import find_library
from dataclasses import dataclass
from importlib import import_module
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from dextron_bench.world.rendering import visuals
from dextron_bench.world.simulator import mujoco

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # The library of each off-screen backend, best first.
INSTALL = (
    "install EGL (Debian: apt install libegl1 libgl1-mesa-dri) or OSMesa (apt install libosmesa6), "
    "and set MUJOCO_GL to egl or osmesa"
)
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


class NoGraphics(RuntimeError):
    """Off-screen rendering is not possible; the message says what to install."""


class UnknownCamera(KeyError):
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
    """Renders pictures of one size off screen. Use it in a `with` statement, which frees its memory at the end."""

    def __init__(self, width: int, height: int, supersampling: int = SUPERSAMPLING) -> None:
        """Takes the size of the pictures [pixels] and the supersampling along each side. Raises NoGraphics."""
        self._supersampling = supersampling
        self._size = width, height = width * supersampling, height * supersampling
        self._model = visuals.visual_model()
        self._data = mujoco.MjData(self._model)
        with warnings.catch_warnings(action="ignore"):  # GLFW warns of the errors that are raised below.
            self._context = create_context(width, height)
            self._context.make_current()
        try:
            self._graphics = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except mujoco.FatalError as error:
            raise NoGraphics(f"cannot draw off screen: {error}; {INSTALL}") from error
        mujoco.mjr_resizeOffscreen(width, height, self._graphics)  # A larger buffer costs time in every picture.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._graphics)
        self._scene = mujoco.MjvScene(self._model, maxgeom=1000)
        self._option = mujoco.MjvOption()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._graphics.free()
        self._context.free()

    def render(self, state: np.ndarray, camera: Camera, lights: int = 1) -> np.ndarray:
        """A picture (height, width, 3) uint8 of a state (48,), averaged over `lights` positions of the key light."""
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


def _disc(n: int, radius: float) -> np.ndarray:
    """Points (n, 3) that cover a horizontal disc evenly; only the centre if n is 1."""
    i = np.arange(n)
    r, turn = radius * np.sqrt(i / n), i * np.pi * (3 - np.sqrt(5))
    return np.stack([r * np.cos(turn), r * np.sin(turn), np.zeros(n)], axis=1)


class Context(Protocol):
    """An OpenGL context."""

    def make_current(self) -> None: ...
    def free(self) -> None: ...


def create_context(width: int, height: int) -> Context:
    """Creates an OpenGL context with the backend that MUJOCO_GL names, or the first with an installed library.

    Raises NoGraphics.
    """
    backend = os.environ.get("MUJOCO_GL", "").lower().strip()
    backend = backend or next((name for name, library in LIBRARIES.items() if find_library(library)), "")
    if backend not in (*LIBRARIES, "glfw"):
        raise NoGraphics(f"cannot draw off screen with MUJOCO_GL={backend!r}: {INSTALL}")
    try:
        return import_module(f"mujoco.{backend}").GLContext(width, height)
    except Exception as error:  # Each library has its own errors.
        raise NoGraphics(f"cannot draw off screen with MUJOCO_GL={backend}: {error}; {INSTALL}") from error
