"""The contract between the harness and a method that trains: what a learner offers, and what it receives.

The harness (`dextron_bench/training`) runs the epochs, writes files, resumes a killed training, makes the learning
curve and picks the best snapshot of the weights. A learner owns its networks and its experience. To write a learner:

1. Write a frozen dataclass with the members of `Learner`; its fields are the settings and the flags of `run`.
2. Return from `trainer` an object with the members of `Trainer`. It trains all given seeds together.
3. Return from `policy` an agent that acts with the weights of one seed (`dextron_bench.methods.agents.Agent`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

import numpy as np

if TYPE_CHECKING:  # The process of an isolated agent imports this module, and may not import the world.
    from dextron_bench.experts.policies import Case
    from dextron_bench.methods.agents import Agent
    from dextron_bench.reaches.setting import Source

Arrays = dict[str, np.ndarray]  # Arrays by name, the content of a safetensors file.


def _report_nothing(done: int, total: int, note: str) -> None:
    """Shows no progress."""


@dataclass(frozen=True, slots=True)
class TrainingSetup:
    """What a learner trains with.

    `source` gives the reaches, and `cases` are the rows of `train`: settings with their experts. `cache` is a folder
    for files that can be made again, such as demonstrations; several learners may share it. `threads` is the number of
    threads of the simulation (0: one per processor); results must not depend on it. `device` is the PyTorch device of
    the networks. `report` receives how far a learner is that prepares something for minutes before its first epoch:
    the number of units done, their number, and what is being prepared.
    """

    source: Source
    cases: Sequence[Case]
    cache: Path
    threads: int = 0
    device: str = "cpu"
    report: Callable[[int, int, str], None] = _report_nothing


class Trainer(Protocol):
    """Trains one agent for each of S seeds, all S together; lists have one element per seed, in the order of the seeds.

    Resuming must be exact to the bit: a new trainer that receives another trainer's `state` and all its `journal`s in
    `restore` must continue as the other would have. Between epochs only, the harness calls `weights`, `state`,
    `journal` and `restore`.
    """

    epoch: int  # Number of finished epochs.

    def advance(self) -> list[dict[str, float]]:
        """Trains for one epoch; returns the epoch's metrics for each seed.

        Values are finite numbers, or arrays and tensors of one element; leave out a metric that is not known. `frames`
        is the total number of control steps that the agent has acted in so far. `epoch` and `seed` name no metrics.
        """
        ...

    def weights(self) -> list[Arrays]:
        """Copies of the arrays that `Learner.policy` needs to act as the agents act now, for each seed."""
        ...

    def state(self) -> Arrays:
        """Everything that training continues from, except what the journals hold."""
        ...

    def journal(self) -> Arrays:
        """The experience gathered since the last call of `journal`; may be empty."""
        ...

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Continues from another trainer's `state`; `journals` are all its journals up to that state, oldest first."""
        ...


@runtime_checkable
class Learner(Protocol):
    """A method that trains: a frozen dataclass whose fields are its settings, each with a default.

    `trainer` returns an object with the members of `Trainer`, which trains all given seeds together. `policy` returns
    the agent that acts with the weights of one seed. The fields of the dataclass are also flags of `run`. A method
    `demonstrations(episodes)` is optional: it returns how many expert episodes the training uses if `train` has
    `episodes` cases.

    `name` names the method, such as "rlil". `train_source` names the source of reaches on which the method is always
    trained and evaluated, such as "minjerk" for SIM; if it is empty, the run chooses the source.
    """

    name: ClassVar[str]
    train_source: ClassVar[str]

    @property
    def label(self) -> str:
        """The name of the runs and of the leaderboard row; settings that differ give labels that differ: "rlil-0.1"."""
        ...

    @property
    def epochs(self) -> int:
        """How many epochs the training lasts."""
        ...

    @property
    def period(self) -> int:
        """Number of epochs between checkpoints; the harness scores each checkpoint for the learning curve."""
        ...

    @property
    def timing_run(self) -> Learner:
        """A short learner, perhaps this one, whose last epoch takes as long as a typical epoch of this one.

        The harness trains it to estimate the time of a whole training.
        """
        ...

    def trainer(self, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        """A new trainer for these seeds, with `epoch` 0; equal seeds give equal trainings."""
        ...

    def policy(self, weights: Mapping[str, np.ndarray]) -> Agent:
        """The deterministic agent that acts with one seed's weights, an element of `Trainer.weights`."""
        ...


@runtime_checkable
class PolicyTransfer(Protocol):
    """A method that trains nothing and plays the trained policy of a learner on other reaches, as SOR does."""

    name: ClassVar[str]

    @property
    def label(self) -> str:
        """The name of the runs and of the leaderboard row."""
        ...

    @property
    def source_policy(self) -> Learner:
        """The learner whose trained policy is played."""
        ...
