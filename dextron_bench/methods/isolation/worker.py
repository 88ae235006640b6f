"""The process of an agent written in Python: makes it from what it is told as JSON on the command line, and answers.

Installed methods are loaded before the guard closes, since their code is the user's own; all else after it.
"""

from __future__ import annotations

import json
import os
import sys
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dextron_bench.methods import loading
from dextron_bench.methods.isolation import guard, policy_files, protocol
from dextron_bench.storage import tensors

GROUP = "dextron_bench.methods"


def main(told: dict[str, Any]) -> None:
    """Serves the agent told of until the input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # What an agent prints is no answer.
    questions = sys.stdin.buffer
    installed = _installed(told["spec"]) if told["kind"] == "method" else None
    guard.close([Path(place) for place in told["own"]], Path(told["scratch"]))
    seed = json.loads(questions.readline())["seed"]
    agent = _made(told, installed, seed)
    answers.write(json.dumps({"protocol": protocol.PROTOCOL, "name": told["spec"]}).encode() + b"\n")
    answers.flush()
    serve(agent, questions, answers)


def serve(agent: Any, questions: BinaryIO, answers: BinaryIO) -> None:
    """Answers each question with an agent's `reset` and `act`."""
    for line in questions:
        reset, states = protocol.asked(line)
        if len(reset):
            agent.reset(reset)
        found = np.asarray(agent.act(states))
        if found.shape != (len(states), 1) or found.dtype.kind != "f":
            raise TypeError(
                f"act() must return floats of shape ({len(states)}, 1) for states of shape {states.shape}; "
                f"it returned {found.dtype} of shape {found.shape}"
            )
        answers.write(protocol.answer(found))
        answers.flush()


def _installed(spec: str) -> Any:
    """The class of an installed method, and all that making it needs."""
    found = entry_points(group=GROUP, name=spec)
    if not found:
        raise LookupError(f"no method {spec!r} is installed")
    return next(iter(found)).load()


def _made(told: dict[str, Any], installed: Any, seed: int) -> Any:
    """The agent, ready to act."""
    if told["kind"] == "policy":
        return policy_files.load(Path(told["spec"]))
    found = installed or loading.find(told["spec"])
    if not isinstance(found, type) or not hasattr(found, "name"):
        raise LookupError(f"{told['spec']!r} is no class with a `name`")
    method = found(**told["settings"])
    if told["weights"]:
        taught = getattr(method, "source_policy", method)
        return taught.policy(tensors.read(Path(told["weights"])))
    return method.agent(seed)


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
