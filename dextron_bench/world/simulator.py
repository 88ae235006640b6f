"""MuJoCo, imported also where no picture can be drawn: the package takes it from here.

`import mujoco` loads the OpenGL library that MUJOCO_GL names, and fails without it. Only pictures need that library;
`rendering` says what is missing when a picture is drawn.
"""

from __future__ import annotations

import os
import warnings
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

GRAPHICS = ("MUJOCO_GL", "PYOPENGL_PLATFORM")  # The second one is set by the import that the first one asks for.
MESA = ("egl", "osmesa")  # Values of MUJOCO_GL with which an import may load Mesa.


def load(name: str) -> Any:
    """The module of that name, without graphics if its import fails with them. Raises what fails without them, too."""
    if os.environ.get("MUJOCO_GL", "").lower().strip() in MESA:
        import_triton()
    before = {variable: os.environ.get(variable) for variable in GRAPHICS}
    try:
        with warnings.catch_warnings(action="ignore"):  # GLFW warns where there is no screen.
            return import_module(name)
    except Exception:  # Each OpenGL library has its own errors: ImportError, AttributeError, RuntimeError, OSError.
        os.environ["MUJOCO_GL"] = "disabled"
        return import_module(name)
    finally:
        if os.environ.get("MUJOCO_GL") != before["MUJOCO_GL"]:
            for variable, value in before.items():
                _set(variable, value)


@cache
def import_triton() -> None:
    """Imports Triton, if it works here, before Mesa is loaded.

    Mesa and Triton each contain an LLVM. The optimizers of torch import Triton, which ends a process that has loaded
    Mesa's LLVM in a segmentation fault; in the other order, both work. If Mesa's LLVM is already here, it is too late.
    """
    with suppress(Exception):  # Triton exists only where this file does.
        if "libLLVM" not in Path("/proc/self/maps").read_text(encoding="utf-8"):
            import_module("triton")


def _set(variable: str, value: str | None) -> None:
    """Sets a variable of the environment; None removes it."""
    if value is None:
        os.environ.pop(variable, None)
    else:
        os.environ[variable] = value


if TYPE_CHECKING:
    import mujoco
else:
    mujoco = load("mujoco")
Batch: Any = load("mujoco.batch").Batch

__all__ = ["Batch", "load", "mujoco"]
