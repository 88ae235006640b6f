"""OpenGL contexts for drawing off screen, and what a process must do before its first one."""

from __future__ import annotations

import os
import warnings
from ctypes.util import find_library
from importlib import import_module
from typing import Protocol

from dextron_bench.errors import Failed
from dextron_bench.world.simulator import import_triton

LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # The library of each off-screen backend, best first.
INSTALL = (
    "install EGL (Debian: apt install libegl1 libopengl0 libgl1-mesa-dri) or OSMesa (apt install libosmesa6), "
    "and set MUJOCO_GL to egl or osmesa"
)
_drew: list[int] = []  # The process that created the first context: this one, or one that it was forked from.


class NoGraphics(Failed):
    """Off-screen rendering is not possible; the message says what to install or to change."""


class Context(Protocol):
    """An OpenGL context."""

    def make_current(self) -> None: ...
    def free(self) -> None: ...


def create_context(width: int, height: int) -> Context:
    """Creates an OpenGL context with the backend that MUJOCO_GL names, or else with the first that works here.

    The context is current. Raises NoGraphics.
    """
    refuse_fork()
    named = os.environ.get("MUJOCO_GL", "").lower().strip()
    backends = [named] if named else [name for name, library in LIBRARIES.items() if find_library(library)]
    if not backends or backends[0] not in (*LIBRARIES, "glfw"):
        raise NoGraphics(f"cannot draw off screen with MUJOCO_GL={named!r}: {INSTALL}")
    import_triton()
    while True:
        backend = backends.pop(0)
        try:
            context = _create(backend, width, height)
        except Exception as error:  # Each library has its own errors; PyOpenGL without a library: AttributeError.
            if not backends:
                raise NoGraphics(f"cannot draw off screen with MUJOCO_GL={backend}: {error}; {INSTALL}") from error
            os.environ.pop("PYOPENGL_PLATFORM", None)  # The next backend refuses another one here.
            continue
        if not _drew:
            _drew.append(os.getpid())
        return context


def _create(backend: str, width: int, height: int) -> Context:
    """A current context of one backend; raises what its library raises."""
    with warnings.catch_warnings(action="ignore"):  # GLFW warns of the errors that are raised.
        context = import_module(f"mujoco.{backend}").GLContext(width, height)
        context.make_current()
        if backend == "glfw" and not import_module("glfw").get_current_context():
            raise RuntimeError("GLFW opened no window")  # MuJoCo would abort the process when it draws again.
    return context


def refuse_fork() -> None:
    """Raises NoGraphics in a process that was forked from one that has drawn: drawing would hang there for ever."""
    if _drew and os.getpid() not in _drew:
        raise NoGraphics(
            "cannot draw in a process that was forked from one that has drawn, because the threads of its graphics "
            "driver are missing here; start it with the method 'spawn' or 'forkserver', or draw only after the fork"
        )
