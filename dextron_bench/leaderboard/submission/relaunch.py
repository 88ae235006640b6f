"""How to start the agent of a bundle again."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from dextron_bench.leaderboard.submission import bundle
from dextron_bench.leaderboard.submission.entry import MANIFEST_KINDS
from dextron_bench.methods import registry, specs
from dextron_bench.methods.isolation.launch import Launch, prepare_launch
from dextron_bench.methods.specs import AgentSpec

LOCATION = re.compile(r"[A-Za-z0-9][\w.+-]*", re.ASCII)  # A file of the bundle, without folders, or a module.
CLASS = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def launch_of(told: Mapping[str, Any], files: Path) -> Launch:
    """How to start the agent that a manifest tells of, from the files that it brought alone.

    Raises BadBundle, AgentError.
    """
    if told["kind"] == "exec":
        raise bundle.BadBundle("an agent that is a program of its own cannot be run again from its bundle")
    spec = _checked_spec(told["kind"], told["spec"])
    weights = _own(files, told["weights"]) if told["weights"] else None
    if spec.file:
        spec = replace(spec, location=str(_own(files, spec.location)))
    return prepare_launch(str(spec), told["settings"], weights)


def _checked_spec(kind: str, text: str) -> AgentSpec:
    """The spec of a manifest if it names an installed method, a module, or a file without folders; raises BadBundle."""
    refusal = bundle.BadBundle(f"{text!r} names no agent of kind {kind!r}")
    try:
        spec = specs.parse(text)
    except specs.BadSpec as error:
        raise refusal from error
    if spec.kind == "method":
        allowed = spec.name in registry.installed_methods()
    else:
        allowed = LOCATION.fullmatch(spec.location) and (spec.kind == "policy" or CLASS.fullmatch(spec.name))
    if MANIFEST_KINDS[spec.kind] != kind or not allowed:
        raise refusal
    return spec


def _own(files: Path, name: str) -> Path:
    if Path(name).name != name or not (files / name).is_file():
        raise bundle.BadBundle(f"the bundle lacks the agent's file {name}")
    return files / name
