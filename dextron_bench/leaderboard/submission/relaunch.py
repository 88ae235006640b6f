"""How to start the agent of a bundle again."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dextron_bench.leaderboard.submission import bundle
from dextron_bench.methods import registry
from dextron_bench.methods.isolation.launch import Launch, launch

CODE = re.compile(r"(?!exec:)[A-Za-z0-9][\w.+-]*:[A-Za-z_]\w*", re.ASCII)  # In a file that was brought, or a module.


POLICY = re.compile(r"[A-Za-z0-9][\w.+-]*\.(?:pt|onnx)", re.ASCII)


def launch_of(told: Mapping[str, Any], files: Path) -> Launch:
    """How to start the agent that a manifest tells of, from the files that it brought alone.

    Raises BadBundle, AgentError.
    """
    kind, spec = told["kind"], told["spec"]
    if kind == "exec":
        raise bundle.BadBundle("an agent that is a program of its own cannot be run again from its bundle")
    if not {"method": registry.known().__contains__, "code": CODE.fullmatch, "policy": POLICY.fullmatch}[kind](spec):
        raise bundle.BadBundle(f"{spec!r} names no agent of kind {kind!r}")
    weights = _own(files, told["weights"]) if told["weights"] else None
    name, _, inside = spec.partition(":")
    if kind == "policy" or name.endswith(".py"):
        spec = ":".join([str(_own(files, name)), *([inside] if inside else [])])
    return launch(spec, told["settings"], weights)


def _own(files: Path, name: str) -> Path:
    if Path(name).name != name or not (files / name).is_file():
        raise bundle.BadBundle(f"the bundle lacks the agent's file {name}")
    return files / name
