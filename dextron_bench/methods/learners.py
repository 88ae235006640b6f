"""What a method that trains offers, and what it is given: the contract between the harness and a learner.

The harness (`training.py`) owns epochs, files, resuming, the learning curve and the choice of a checkpoint;
a learner owns its networks and its experience.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Protocol, runtime_checkable

import numpy as np

if TYPE_CHECKING:  # A learner's file is read by the isolated process of its agent, which may not import the world.
    from dextron_bench.experts.policies import Case
    from dextron_bench.methods.agents import Agent
    from dextron_bench.reaches.setting import Source

Arrays = dict[str, np.ndarray]  # Named arrays, as a safetensors file holds them.


@dataclass(frozen=True, slots=True)
class Track:
    """What there is to train with: reaches, the cases of `train`, threads and device to compute on.

    `cache` is a folder for what can be made again, such as demonstrations; others may use it too.
    """

    source: Source
    cases: Sequence[Case]
    cache: Path
    threads: int = 0
    device: str = "cpu"


class Trainer(Protocol):
    """The training of one agent for each of S seeds, together.

    A trainer made anew, `restore`d from another's `state` and all its `journal`s, goes on bit for bit as
    the other would have. Both are asked for between epochs only.
    """

    epoch: int  # Epochs done.

    def advance(self) -> list[dict[str, float]]:
        """Trains for one epoch; returns what to note of it, for each seed: finite numbers, what is unknown left out.

        `frames` is the number of control steps that the agent has lived through so far.
        """
        ...

    def weights(self) -> list[Arrays]:
        """What `Learner.policy` needs to act as the agents do now, for each seed; copies."""
        ...

    def state(self) -> Arrays:
        """All that training goes on from, but what journals hold."""
        ...

    def journal(self) -> Arrays:
        """The experience gathered since the last journal was asked for; may be empty."""
        ...

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Puts the trainer where the one was that gave this state and, before it, these journals in order."""
        ...


@runtime_checkable
class Learner(Protocol):
    """A method that trains: a frozen dataclass whose fields are its settings, each with a default.

    `label` names its runs and its row, and distinguishes settings, as "rlil-0.1" does. It trains for `epochs`; every
    `period` epochs there is a checkpoint and a point of the learning curve. `train_source` names the source of reaches
    on which it is trained and evaluated, whatever source a run asks for: "minjerk" for SIM; if it is empty, the run
    decides. `timing_run` is a learner, perhaps itself, whose last epoch takes as long as most epochs of this one: it
    serves to estimate the time of a training.
    """

    name: ClassVar[str]
    train_source: ClassVar[str]

    @property
    def label(self) -> str: ...

    @property
    def epochs(self) -> int: ...

    @property
    def period(self) -> int: ...

    @property
    def timing_run(self) -> Learner: ...

    def trainer(self, track: Track, seeds: Sequence[int]) -> Trainer:
        """A trainer at its start, 0 epochs done."""
        ...

    def policy(self, weights: Mapping[str, np.ndarray]) -> Agent:
        """The deterministic agent of a seed's weights."""
        ...


@runtime_checkable
class PolicyTransfer(Protocol):
    """A method that trains nothing: it takes the policy of the learner `source_policy` to other reaches, like SOR."""

    name: ClassVar[str]

    @property
    def label(self) -> str: ...

    @property
    def source_policy(self) -> Learner: ...
