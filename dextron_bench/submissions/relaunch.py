"""Starts the agent of a bundle again, from the files of the bundle alone."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from dextron_bench.methods import registry, specs
from dextron_bench.methods.isolation.launch import Launch, prepare_launch
from dextron_bench.methods.specs import AgentSpec
from dextron_bench.submissions import bundle
from dextron_bench.submissions.entry import MANIFEST_KINDS
from dextron_bench.submissions.manifest import Agent

LOCATION = re.compile(r"[A-Za-z0-9][\w.+-]*", re.ASCII)  # A file of the bundle, without folders, or a module.
CLASS = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def launch_of(agent: Agent, files: Path, trust: bool = False) -> Launch:
    """How to start the agent that a manifest describes, from the folder of its files; raises BadBundle, AgentError.

    Without `trust` it starts in the sandbox only.
    """
    if agent.kind == "exec":
        raise bundle.BadBundle("a bundle does not contain the program of an `exec:` agent, so it cannot run again")
    spec = _checked_spec(agent.kind, agent.spec)
    weights = _agent_file(files, agent.weights) if agent.weights else None
    if spec.file:
        spec = replace(spec, location=str(_agent_file(files, spec.location)))
    return replace(prepare_launch(str(spec), agent.settings, weights), trusted=trust)


def _checked_spec(kind: str, text: str) -> AgentSpec:
    """The spec of a manifest if it names an installed method, a module, or a file without folders; raises BadBundle."""
    refusal = bundle.BadBundle(f"{text!r} does not name an agent of kind {kind!r}")
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


def _agent_file(files: Path, name: str) -> Path:
    """The path of an agent's file; raises BadBundle if the bundle has no such file."""
    if Path(name).name != name or not (files / name).is_file():
        raise bundle.BadBundle(f"the bundle lacks the agent's file {name}")
    return files / name
