"""Runs on the tiny benchmark, and the file of an agent with constant actions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dextron_bench.runs import execution
from dextron_bench.runs.plans import Plan, resolve

CONSTANT = """
import numpy as np

class Constant:
    name = "{name}"
    def agent(self, seed): return self
    def reset(self, episodes): ...
    def act(self, states): return np.full((len(states), 1), {value})
"""


def execute(runs: Path, plan: Plan) -> Path:
    """Resolves and executes a plan; returns the folder of the run."""
    return execution.execute(resolve(plan), runs, threads=1)


def constant_agent(folder: Path, value: str, name: str = "constant") -> str:
    """Writes an agent whose actions all have one value, a Python expression; returns its spec."""
    file = folder / "constant.py"
    file.write_text(CONSTANT.format(name=name, value=value))
    return f"{file}:Constant"


def forbidden(*_: object, **__: object) -> Any:
    """Replaces a function that a test does not allow to be called."""
    raise AssertionError("repeated finished work")
