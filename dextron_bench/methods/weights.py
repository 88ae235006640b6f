"""Weights of trained methods: the file of a run, those that ship beside a method's code, and a user's own."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.methods import registry, weights
from dextron_bench.methods.agents import Agent, AgentError, as_agent_error
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.storage import hashing, tensors
from dextron_bench.world import model

FILE = "weights.safetensors"  # In a run's folder.
TOLD = ("label", "reaches", "seeds", "epochs", "best_epoch", "frames")  # What a result says of its weights.


class MissingWeights(LookupError):
    """Weights that do not ship."""


class BadWeights(ValueError):
    """A file of weights that does not fit its method."""


def place(learner: Learner, reaches: str) -> Path:
    """The folder of the weights that ship for a method on a source of reaches: beside its code."""
    return Path(inspect.getfile(type(learner))).parent / "weights" / learner.label / reaches


def shipped(learner: Learner, reaches: str) -> dict[int, Path]:
    """The weights that ship for a method on a source of reaches, by seed, in order."""
    files = place(learner, reaches).glob("seed*.safetensors")
    found = {file.stem.removeprefix("seed"): file for file in files}
    return {int(seed): found[seed] for seed in sorted(found, key=lambda s: (len(s), s)) if seed.isdigit()}


def labels(learner: Learner, reaches: str) -> list[str]:
    """What weights for a source of reaches ship beside a method's code, its own or its neighbours'."""
    return sorted(found.parent.name for found in place(learner, reaches).parents[1].glob(f"*/{reaches}"))


def everything(reaches: str) -> list[Path]:
    """All weights that ship for a source of reaches, those of the methods' own and their neighbours', in order."""
    learners = [made for made in map(registry.create, registry.known()) if isinstance(made, Learner)]
    beside = {place(learner, reaches).parents[1] for learner in learners}
    return sorted(file for folder in beside for file in folder.glob(f"*/{reaches}/seed*.safetensors"))


def about(file: Path) -> dict[str, Any]:
    """What a file's weights come from, and the SHA-256 of the file; raises BadTensors, OSError."""
    found = tensors.read_about(file)
    return {**{name: found[name] for name in TOLD if name in found}, "sha256": hashing.sha256(file)}


def seed(file: Path) -> int:
    """The seed of a file's weights, 0 where it does not say; raises BadTensors, OSError."""
    found = tensors.read_about(file).get("seed")
    return found if type(found) is int and found >= 0 else 0


def agent(learner: Learner, file: Path) -> Agent:
    """The agent of a file's weights; raises BadWeights, BadTensors, OSError."""
    arrays = tensors.read(file)
    found = tensors.read_about(file).get("label", learner.label)
    if found != learner.label:
        raise BadWeights(f"{file} holds weights of {found!r}, not of {learner.label!r}")
    if bad := [name for name, array in arrays.items() if not np.isfinite(array).all()]:
        raise BadWeights(f"{file} holds numbers in {bad[0]!r} that are not finite")
    try:
        with as_agent_error("policy()"):
            made = learner.policy(arrays)
            made.reset(np.arange(1))
            shape = np.shape(made.act(np.tile(_still(), (1, 1))))
    except AgentError as error:
        cause = error.__cause__
        raise BadWeights(
            f"{file} holds no weights that fit {learner.label!r} ({type(cause).__name__}: {cause})"
        ) from error
    if shape != (1, 1):
        raise BadWeights(f"{file} holds no weights that fit {learner.label!r}: actions of shape {shape} for one state")
    return learner.policy(arrays)


def own(file: Path) -> Agent:
    """The agent of a file that says whose weights it holds; raises BadWeights, UnknownMethod, BadTensors, OSError."""
    found = tensors.read_about(file)
    if not {"method", "settings"} <= found.keys():
        raise BadWeights(f"{file} does not say which method's weights it holds")
    learner = registry.create(found["method"], found["settings"])
    if not isinstance(learner, Learner):
        raise BadWeights(f"{file} says it holds weights of {found['method']!r}, which has none")
    return agent(learner, file)


def _still() -> np.ndarray:
    """A state (48,) at rest."""
    return np.concatenate([model.half_closed(), np.zeros(model.STATE - len(model.half_closed()))])


def agent_by_name(name: str, reaches: str, seed: int = 0) -> tuple[str, Agent]:
    """The agent that a name stands for: a row of the leaderboard whose weights ship, or its beginning; or a method.

    Raises MissingWeights, UnknownMethod, BadSettings, AgentError.
    """
    ships = {file.parts[-3]: file for file in weights.everything(reaches) if file.stem == f"seed{seed}"}
    if label := next((label for label in ships if label == name or label.startswith(f"{name}-")), None):
        return label, weights.own(ships[label])
    method = registry.create(name, reaches=reaches)
    if isinstance(method, Learner | PolicyTransfer):
        raise weights.MissingWeights(
            f"no weights of {name!r} ship for {reaches} reaches and seed {seed}; there are {', '.join(ships) or 'none'}"
        )
    with as_agent_error(f"agent({seed}) of method {name!r}"):
        return registry.label(method), method.agent(seed)
