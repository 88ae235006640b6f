"""The process of an agent written in Python: creates the agent that its command line describes, and answers questions.

An installed method is imported before the guard is installed, because the user has chosen to install its code. All
other code is imported after it.
"""

from __future__ import annotations

import json
import os
import sys
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dextron_bench.methods import loading
from dextron_bench.methods.isolation import guard, policy_files, protocol
from dextron_bench.methods.specs import AgentSpec
from dextron_bench.storage import tensors


def main(request: dict[str, Any]) -> None:
    """Answers questions for the agent of a Launch, given as a dict with its `scratch` folder, until the input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # What an agent prints goes to stderr, not among the answers.
    questions = sys.stdin.buffer
    spec = AgentSpec(**request["spec"])
    installed = loading.load_class(spec) if spec.kind == "method" else None
    if spec.kind == "module":
        sys.meta_path.append(_Package(spec.location.partition(".")[0], request["folder"]))
    guard.install([Path(path) for path in request["readable"]], Path(request["scratch"]))
    seed = json.loads(questions.readline())["seed"]
    agent = _create_agent(spec, installed, request["settings"], request["weights"], seed)
    answers.write(json.dumps({"protocol": protocol.PROTOCOL, "name": str(spec)}).encode() + b"\n")
    answers.flush()
    serve(agent, questions, answers)


def serve(agent: Any, questions: BinaryIO, answers: BinaryIO) -> None:
    """Answers each question with the agent's `reset` and `act`."""
    for line in questions:
        reset, states = protocol.read_question(line)
        if len(reset):
            agent.reset(reset)
        actions = np.asarray(agent.act(states))
        if actions.shape != (len(states), 1) or actions.dtype.kind != "f":
            raise TypeError(
                f"act() must return floats of shape ({len(states)}, 1) for states of shape {states.shape}; "
                f"it returned {actions.dtype} of shape {actions.shape}"
            )
        answers.write(protocol.write_actions(actions))
        answers.flush()


class _Package(MetaPathFinder):
    """Finds one package in a folder that the guard lets nobody list, after all other packages."""

    def __init__(self, name: str, folder: str) -> None:
        self._name, self._spec = name, PathFinder.find_spec(name, [folder])

    def find_spec(self, fullname: str, *_: object) -> ModuleSpec | None:
        """The package, under its own name only."""
        return self._spec if fullname == self._name else None


def _create_agent(spec: AgentSpec, installed: Any, settings: dict[str, Any], weights: str, seed: int) -> Any:
    if spec.kind == "policy":
        return policy_files.load(Path(spec.location))
    cls = installed or loading.load_class(spec)
    if not isinstance(cls, type) or not hasattr(cls, "name"):
        raise LookupError(f"{str(spec)!r} is not a class with a `name`")
    method: Any = cls(**settings)
    if weights:
        learner = getattr(method, "source_policy", method)
        return learner.policy(tensors.read(Path(weights)))
    return method.agent(seed)


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
