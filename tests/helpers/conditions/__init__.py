"""Conditions of machines that Python can imitate: each module here changes this process when it is imported.

A whole command runs under conditions with this folder on PYTHONPATH, where Python finds `sitecustomize`:

    PYTHONPATH=tests/helpers/conditions CONDITIONS=no_flock,no_links dextron-bench run --method exp

All Python processes that the command starts have the same conditions. They change Python's functions alone: what
MuJoCo, Rerun or a shell calls does not change. `tests.helpers.conditions.environment("no_flock")` is for tests.
"""

from __future__ import annotations

import os
from pathlib import Path

FOLDER = Path(__file__).parent
ROOT = Path(__file__).parents[3]


def environment(*names: str) -> dict[str, str]:
    """The variables of a process that runs under conditions, with the benchmark of this checkout."""
    return {**os.environ, "PYTHONPATH": f"{FOLDER}{os.pathsep}{ROOT}", "CONDITIONS": ",".join(names)}
