"""How the world looks: pictures of states, rendered off screen."""

from __future__ import annotations

import os
import warnings
from ctypes.util import find_library
from dataclasses import dataclass
from importlib import import_module
from types import TracebackType
from typing import Protocol, Self

import mujoco
import numpy as np

from dextron_bench.world.rendering import visuals

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # Ways to draw without a screen, best first, and what each needs.
INSTALL = (
    "install EGL (Debian: apt install libegl1 libgl1-mesa-dri) or OSMesa (apt install libosmesa6), "
    "and set MUJOCO_GL to egl or osmesa"
)
SUPERSAMPLING = 2  # Pixels of stills are rendered this many times smaller than they come out.
LIGHT_RADIUS = 0.35  # [m] of the lamp that throws soft shadows.


@dataclass(frozen=True, slots=True)
class Camera:
    """Looks at a point [m] from a distance [m]; azimuth and elevation in degrees, as in MuJoCo."""

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
    """No way to draw off screen."""


class UnknownCamera(KeyError):
    """A camera that there is not."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no camera {name!r}; choose from {', '.join(sorted(CAMERAS))}")

    def __str__(self) -> str:
        return str(self.args[0])


def render(state: np.ndarray, width: int = 640, height: int = 480, camera: str = "side", lights: int = 1) -> np.ndarray:
    """One picture, RGB (height, width, 3) uint8, of a state (48,). More `lights` make shadows softer.

    Raises NoGraphics and UnknownCamera.
    """
    return frames(state[None], width, height, camera, lights)[0]


def frames(
    states: np.ndarray, width: int = 640, height: int = 480, camera: str = "side", lights: int = 1
) -> np.ndarray:
    """Pictures (T, height, width, 3) uint8 of states (T, 48); raises as `render`."""
    if camera not in CAMERAS:
        raise UnknownCamera(camera)
    with Painter(width, height) as painter:
        return np.stack([painter.paint(state, CAMERAS[camera], lights) for state in states])


class Painter:
    """An off-screen picture of fixed size, to be painted again and again; free it with `with`."""

    def __init__(self, width: int, height: int, supersampling: int = SUPERSAMPLING) -> None:
        """Takes the size of pictures [pixels] and how many times finer they are rendered; raises NoGraphics."""
        self._finer = supersampling
        self._size = width, height = width * supersampling, height * supersampling
        self._model = visuals.visual_model()
        self._data = mujoco.MjData(self._model)
        with warnings.catch_warnings(action="ignore"):  # GLFW says by them what the errors below do.
            self._context = context(width, height)
            self._context.make_current()
        try:
            self._graphics = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        except mujoco.FatalError as error:
            raise NoGraphics(f"cannot draw off screen: {error}; {INSTALL}") from error
        mujoco.mjr_resizeOffscreen(width, height, self._graphics)  # A larger one costs time in every picture.
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._graphics)
        self._scene = mujoco.MjvScene(self._model, maxgeom=1000)
        self._option = mujoco.MjvOption()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._graphics.free()
        self._context.free()

    def paint(self, state: np.ndarray, camera: Camera, lights: int = 1) -> np.ndarray:
        """A picture, averaged over so many places of the key light."""
        self._data.qpos[:] = state[: self._model.nq]
        mujoco.mj_forward(self._model, self._data)
        key = self._model.light("key").id
        home = self._data.light_xpos[key].copy()
        total = np.zeros((self._size[1], self._size[0], 3))
        for shift in _disc(lights, LIGHT_RADIUS):
            self._data.light_xpos[key] = home + shift
            total += self._shot(camera)
        picture = total / lights
        n = self._finer
        rows = picture[::-1].reshape(self._size[1] // n, n, self._size[0] // n, n, 3)
        return np.round(rows.mean(axis=(1, 3))).astype(np.uint8)

    def _shot(self, camera: Camera) -> np.ndarray:
        """One rendered picture, bottom row first."""
        view = mujoco.MjvCamera()
        view.azimuth, view.elevation, view.distance = camera.azimuth, camera.elevation, camera.distance
        view.lookat[:] = camera.target
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self._model, self._data, self._option, None, view, everything, self._scene)
        viewport = mujoco.MjrRect(0, 0, *self._size)
        mujoco.mjr_render(viewport, self._scene, self._graphics)
        pixels = np.empty((self._size[1], self._size[0], 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, viewport, self._graphics)
        return pixels


def _disc(n: int, radius: float) -> np.ndarray:
    """Points (n, 3) spread evenly over a level disc; the centre alone for n = 1."""
    i = np.arange(n)
    r, turn = radius * np.sqrt(i / n), i * np.pi * (3 - np.sqrt(5))
    return np.stack([r * np.cos(turn), r * np.sin(turn), np.zeros(n)], axis=1)


class Context(Protocol):
    """An OpenGL context."""

    def make_current(self) -> None: ...
    def free(self) -> None: ...


def context(width: int, height: int) -> Context:
    """An OpenGL context: of the kind that MUJOCO_GL names, else the first that there is a library for.

    Raises NoGraphics.
    """
    kind = os.environ.get("MUJOCO_GL", "").lower().strip()
    kind = kind or next((name for name, library in LIBRARIES.items() if find_library(library)), "")
    if kind not in (*LIBRARIES, "glfw"):
        raise NoGraphics(f"cannot draw off screen with MUJOCO_GL={kind!r}: {INSTALL}")
    try:
        return import_module(f"mujoco.{kind}").GLContext(width, height)
    except Exception as error:  # Each library fails in its own way.
        raise NoGraphics(f"cannot draw off screen with MUJOCO_GL={kind}: {error}; {INSTALL}") from error
