"""MuJoCo, imported also where no picture can be drawn: the package takes it from here.

`import mujoco` loads the OpenGL library that MUJOCO_GL names, and fails without it. Only pictures need that library;
`rendering` says what is missing when a picture is drawn.
"""

from __future__ import annotations

import os
import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

GRAPHICS = ("MUJOCO_GL", "PYOPENGL_PLATFORM")  # The second one is set by the import that the first one asks for.


def load(name: str) -> Any:
    """The module of that name, without graphics if its import fails with them. Raises what fails without them, too."""
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
