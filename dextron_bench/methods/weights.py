"""Weights of trained methods: the file of a run, files shipped beside a method's code, and files of users."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.methods import registry
from dextron_bench.methods.agents import Agent, AgentError, as_agent_error
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.storage import hashing, tensors
from dextron_bench.storage.folders import visible
from dextron_bench.world import model

SUFFIX = ".safetensors"
METADATA = ("label", "reaches", "seeds", "epochs", "best_epoch", "frames")  # What a result copies from its weights.


class MissingWeights(LookupError):
    """Weights that do not ship."""


class BadWeights(ValueError):
    """A file of weights that does not fit its method."""


def shipped_folder(learner: Learner, reaches: str) -> Path:
    """The folder of a method's shipped weights for a source of reaches; it lies beside the method's code."""
    return Path(inspect.getfile(type(learner))).parent / "weights" / learner.label / reaches


def shipped(learner: Learner, reaches: str) -> dict[int, Path]:
    """The files of a method's shipped weights for a source of reaches, by seed, sorted."""
    paths = visible(shipped_folder(learner, reaches), "seed*.safetensors")
    files = {file.stem.removeprefix("seed"): file for file in paths}
    return {int(seed): files[seed] for seed in sorted(files, key=lambda s: (len(s), s)) if seed.isdigit()}


def shipped_labels(learner: Learner, reaches: str) -> list[str]:
    """Labels of all weights for a source of reaches that ship in the same package as a method, sorted."""
    return sorted(folder.parent.name for folder in visible(shipped_folder(learner, reaches).parents[1], f"*/{reaches}"))


def all_shipped(reaches: str) -> list[Path]:
    """The files of all weights for a source of reaches that ship in the packages of installed methods, sorted."""
    methods = [registry.create(name) for name in registry.installed_methods()]
    folders = {shipped_folder(method, reaches).parents[1] for method in methods if isinstance(method, Learner)}
    return sorted(file for folder in folders for file in visible(folder, f"*/{reaches}/seed*.safetensors"))


def metadata(file: Path, sha256: str = "") -> dict[str, Any]:
    """The training that made a file's weights, and the SHA-256 of the file, which is computed if it is not given.

    Raises BadTensors, OSError.
    """
    header = tensors.read_about(file)
    return {**{name: header[name] for name in METADATA if name in header}, "sha256": sha256 or hashing.sha256(file)}


def seed_of(file: Path) -> int:
    """The seed of a file's weights, 0 if the file does not say it; raises BadTensors, OSError."""
    seed = tensors.read_about(file).get("seed")
    return seed if type(seed) is int and seed >= 0 else 0


def load_agent(learner: Learner, file: Path) -> Agent:
    """The agent of a file's weights, tried on one state; raises BadWeights, BadTensors, OSError."""
    return load_agents(learner, file)()


def load_agents(learner: Learner, file: Path) -> Callable[[], Agent]:
    """Makes agents of a file's weights, which are read once and tried on one state.

    Raises BadWeights, BadTensors, OSError.
    """
    arrays = tensors.read(file)
    label = tensors.read_about(file).get("label", learner.label)
    if label != learner.label:
        raise BadWeights(f"{file} holds weights of {label!r}, not of {learner.label!r}")
    if bad := [name for name, array in arrays.items() if not np.isfinite(array).all()]:
        raise BadWeights(f"{file} holds numbers in {bad[0]!r} that are not finite")
    try:
        with as_agent_error("policy()"):
            agent = learner.policy(arrays)
            agent.reset(np.arange(1))
            shape = np.shape(agent.act(np.tile(_state_at_rest(), (1, 1))))
    except AgentError as error:
        cause = error.__cause__
        raise BadWeights(
            f"{file} holds no weights that fit {learner.label!r} ({type(cause).__name__}: {cause})"
        ) from error
    if shape != (1, 1):
        raise BadWeights(f"{file} holds no weights that fit {learner.label!r}: actions of shape {shape} for one state")
    return lambda: learner.policy(arrays)


def load_agent_from_file(file: Path) -> Agent:
    """The agent of a file that names its own method; raises BadWeights, BadSettings, BadTensors, OSError."""
    method, settings = maker_of(file)
    learner = registry.create(method, settings)
    if not isinstance(learner, Learner):
        raise BadWeights(f"{file} says it holds weights of {method!r}, which has none")
    return load_agent(learner, file)


def maker_of(file: Path) -> tuple[str, dict[str, Any]]:
    """The method and the settings that a file of weights names; raises BadWeights, BadTensors, OSError.

    The method must be installed: a file may come from a stranger, so its metadata never makes other code run.
    """
    header = tensors.read_about(file)
    if "method" not in header or not isinstance(header.get("settings"), dict):
        raise BadWeights(f"{file} does not say which method's weights it holds")
    if header["method"] not in registry.installed_methods():
        raise BadWeights(
            f"{file} says it holds weights of {header['method']!r}, which is not installed; a file of weights never "
            f"imports code: choose from {', '.join(registry.installed_methods())}, or register it (CONTRIBUTING.md)"
        )
    return header["method"], header["settings"]


def agent_by_name(name: str, reaches: str, seed: int = 0) -> tuple[str, Agent]:
    """The label and the agent for a name: a label with shipped weights or its beginning, else a method.

    Raises MissingWeights, UnknownMethod, BadSettings, AgentError.
    """
    files = {file.parts[-3]: file for file in all_shipped(reaches) if file.stem == f"seed{seed}"}
    if label := next((label for label in files if label == name or label.startswith(f"{name}-")), None):
        return label, load_agent_from_file(files[label])
    method = registry.create(name, reaches=reaches)
    if isinstance(method, Learner | PolicyTransfer):
        raise MissingWeights(
            f"no weights of {name!r} ship for {reaches} reaches and seed {seed}; there are {', '.join(files) or 'none'}"
        )
    with as_agent_error(f"agent({seed}) of method {name!r}"):
        return registry.label(method), method.agent(seed)


def _state_at_rest() -> np.ndarray:
    """A state (48,) without motion."""
    return np.concatenate([model.initial_qpos(), np.zeros(model.STATE - len(model.initial_qpos()))])
