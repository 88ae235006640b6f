"""RL: soft actor-critic without demonstrations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines import cycle, demonstrations
from baselines.policy import MeanAgent
from baselines.random_streams import BATCHES, NOISE, Draws
from baselines.sac import BATCH, Batch, Sac
from baselines.schedule import SCHEDULES, Exploration, Schedule, Scheduled
from dextron_bench import Trainer, TrainingSetup
from dextron_bench.errors import BadInput

HELD_SHARE = 0.25  # Share of the episodes after the warm start that hold their noise, if `hold` is above 1.


@dataclass(frozen=True)
class Rl(Scheduled):
    """SAC that learns only from its own episodes (paper, fig. 4a, "RL")."""

    name: ClassVar[str] = "rl"

    hold: int = 1
    """Control steps for which an exploration noise is held; 1 is the paper's. Above 1, updates begin at once."""
    critics: int = 1
    """Number of Q: 1 is the paper's; with 2, V and the policy learn from the smaller value."""

    def __post_init__(self) -> None:
        if self.hold < 1:
            raise BadInput(f"--hold is {self.hold}; a noise is held for at least 1 step")
        if self.critics not in (1, 2):
            raise BadInput(f"--critics is {self.critics}; choose 1 or 2")

    @property
    def stem(self) -> str:
        """The name with the settings that are not the paper's, such as "rl-hold40"."""
        hold = f"-hold{self.hold}" if self.hold > 1 else ""
        return f"{self.method_stem}{hold}{'-2q' if self.critics == 2 else ''}"

    @property
    def method_stem(self) -> str:
        """The part of the label that names the paper's method."""
        return self.name

    def trainer(self, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        """A trainer with one SAC agent per seed, all trained together."""
        exploration = Exploration(self.hold, HELD_SHARE if self.hold > 1 else 0.0)
        return trainer(setup, seeds, SCHEDULES[self.preset], self.demonstrated, exploration, self.critics)

    def policy(self, weights: Mapping[str, np.ndarray]) -> MeanAgent:
        """The agent that plays the policy's mean."""
        return MeanAgent(weights)


class OneUpdate:
    """The Algorithm of RL and RLIL: one update of soft actor-critic at each frame."""

    losses = "action_value_loss", "value_loss", "policy_loss"
    scales_rewards = True

    def __init__(self, rngs: Sequence[np.random.Generator], device: str, critics: int) -> None:
        self.networks, self._device = Sac(rngs, device, critics), device

    def draw(self, draws: Draws) -> tuple[Any, ...]:
        """Numbers that select transitions (FRAMES, S, B), and noises (FRAMES, S, B, 1)."""
        noise = torch.tensor(draws.normal(NOISE, BATCH)[..., None], dtype=torch.float32, device=self._device)
        return draws.uniform(BATCHES, BATCH), noise

    def update(self, batch: Callable[[np.ndarray], Batch], drawn: Sequence[Any]) -> Tensor:
        """Returns the losses (3, S)."""
        uniform, noise = drawn
        return self.networks.update(batch(uniform), noise)


def trainer(
    setup: TrainingSetup,
    seeds: Sequence[int],
    schedule: Schedule,
    demonstrated: int = 0,
    exploration: Exploration = Exploration(),  # noqa: B008 (frozen)
    critics: int = 1,
) -> cycle.Cycle:
    """The trainer of RL, or of RLIL if some transitions of a batch are `demonstrated`."""
    experts = None
    if demonstrated:
        episodes = demonstrations.load(setup, schedule.episodes)
        experts = demonstrations.Streamed.draw(episodes, seeds, schedule.epochs * cycle.FRAMES)
    algorithm = partial(OneUpdate, critics=critics)
    return cycle.Cycle(setup, seeds, schedule, algorithm, experts, demonstrated, exploration)
