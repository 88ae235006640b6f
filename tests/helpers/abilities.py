"""Optional abilities of a machine: without one, a test that fails for the lack of it is skipped, with what brings it.

A test that fails for another reason still fails, and on a machine that has the ability nothing is skipped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec

import pytest


@dataclass(frozen=True, slots=True)
class Ability:
    """What a failure says when the ability is missing, whether this machine has it, and what brings it."""

    sign: str
    is_here: Callable[[], bool]
    reason: str


@cache
def can_draw() -> bool:
    """True if this machine draws pictures off screen; draws one."""
    from dextron_bench.world.rendering import renderer

    try:
        with renderer.Renderer(8, 8):
            return True
    except renderer.NoGraphics:
        return False


NO_PICTURES = "no picture can be drawn here (Debian: apt-get install libegl1 libopengl0 libgl1-mesa-dri, or libosmesa6)"
ABILITIES = (
    Ability("cannot draw off screen", can_draw, NO_PICTURES),
    Ability("torch", lambda: find_spec("torch") is not None, "it learns, and PyTorch is missing: pip install torch"),
    Ability("dm_control", lambda: find_spec("dm_control") is not None, "dm_control is missing: make setup"),
)
MISSING_MODULE = ("No module named '{}'", "needs the Python module {}, which", "environment needs {}")


def skip_without(report: pytest.CollectReport | pytest.TestReport, place: str) -> None:
    """Turns the report of a failure into a skip, if the test failed for lack of an ability that this machine lacks."""
    if not report.failed:
        return
    text = f"{report.longreprtext}{report.capstderr}"
    for ability in ABILITIES:
        signs = [ability.sign] if " " in ability.sign else [form.format(ability.sign) for form in MISSING_MODULE]
        if any(sign in text for sign in signs) and not ability.is_here():
            report.outcome, report.longrepr = "skipped", (place, 0, f"Skipped: {ability.reason}")
            return
