"""DAgger: the agent plays, and the expert of each setting says what it would have done (Ross et al., AISTATS 2011)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from baselines import demonstrations, policy
from baselines.bc import BATCH, Bc, Cloning
from baselines.schedule import SCHEDULES
from dextron_bench import Case, ExpertAgent, Trainer, TrainingSetup
from dextron_bench.methods.learners import Arrays
from dextron_bench.world.engine import Engine

EPISODES = 5  # That each agent plays in an epoch: about 1,000 frames, as in the epochs of the paper.
OWN = BATCH // 2  # States of each batch that the agent met itself; the others are demonstrations.

PLAYED, DEMONSTRATED, MET = 10, 11, 12  # The random streams of each seed.


@dataclass(frozen=True)
class Dagger(Bc):
    """Imitation of the experts in the states that the agent itself meets."""

    name: ClassVar[str] = "dagger"

    def trainer(self, setup: TrainingSetup, seeds: Sequence[int]) -> Trainer:
        """A trainer with one network per seed, all trained together."""
        schedule = SCHEDULES[self.preset]
        return Aggregation(setup, demonstrations.load(setup, schedule.episodes), seeds)


class Aggregation(Cloning):
    """The Trainer of DAgger: clones demonstrations and, in equal parts, the experts' answers to the agents' states."""

    def __init__(self, setup: TrainingSetup, demos: demonstrations.Demonstrations, seeds: Sequence[int]) -> None:
        super().__init__(demos, seeds, setup.device)
        self._setup, self._agents = setup, len(self._seeds)
        self._engine = Engine(self._agents * EPISODES, setup.threads)
        self._met: list[Arrays] = []  # By epoch: states (R, 48), actions (R,), and the agent (R,) that met them.
        self._pools = [_Pool() for _ in self._seeds]

    def advance(self) -> list[dict[str, float]]:
        """Plays EPISODES episodes of each agent, then trains for one epoch; returns losses, frames and returns."""
        played, scores = self._play()
        self._add(played)
        self._met.append(played)
        metrics = super().advance()
        for values, pool, returns in zip(metrics, self._pools, scores, strict=True):
            values |= {"frames": float(len(pool)), "episodes": float(EPISODES), "score": float(returns.mean())}
        return metrics

    def _batches(self) -> Iterator[tuple[Tensor, Tensor]]:
        demonstrated = self._drawn(DEMONSTRATED, len(self._states), BATCH - OWN)
        streams = [np.random.default_rng([seed, MET, self.epoch]) for seed in self._seeds]
        met = [pool.draw(rng, len(demonstrated)) for rng, pool in zip(streams, self._pools, strict=True)]
        states, actions = (np.stack(part, axis=1) for part in zip(*met, strict=True))
        answered = self._scaled(states), torch.tensor(actions[..., None], device=self._device)
        for rows, *pair in zip(demonstrated, *answered, strict=True):
            yield torch.cat([self._states[rows], pair[0]], dim=1), torch.cat([self._actions[rows], pair[1]], dim=1)

    def _play(self) -> tuple[Arrays, np.ndarray]:
        """The states that the agents meet, with their experts' actions, and the returns (S, EPISODES)."""
        cases = [self._case(seed, number) for seed in self._seeds for number in range(EPISODES)]
        slots = np.arange(len(cases))
        experts = ExpertAgent()
        experts.assign(slots, [case.expert for case in cases])
        experts.reset(slots)
        states = self._engine.begin(slots, [self._setup.source.path(case.setting) for case in cases])
        live, returns, met = slots, np.zeros(len(slots)), []
        while live.size:
            answers = experts.act(states)[:, 0]
            met.append((states[live].astype(np.float32), answers[live].astype(np.float32), live // EPISODES))
            step = self._engine.step(live, self._act(states)[live])
            returns[live] += step.rewards
            states[live] = step.states
            live = live[~step.ended]
        parts = zip(("states", "actions", "agents"), zip(*met, strict=True), strict=True)
        return {name: np.concatenate(part) for name, part in parts}, returns.reshape(self._agents, EPISODES)

    def _act(self, states: np.ndarray) -> np.ndarray:
        """The agents' actions (S x EPISODES, 1)."""
        scaled = self._scaled(states).reshape(self._agents, EPISODES, policy.STATE)
        with torch.no_grad():
            mean, _ = policy.head(self._network(scaled))
        return mean.tanh().reshape(-1, 1).double().cpu().numpy()

    def _case(self, seed: int, number: int) -> Case:
        rng = np.random.default_rng([seed, PLAYED, self.epoch, number])
        return self._setup.cases[int(rng.integers(len(self._setup.cases)))]

    def _add(self, played: Arrays) -> None:
        for agent, pool in enumerate(self._pools):
            mine = played["agents"] == agent
            pool.add(played["states"][mine], played["actions"][mine])

    def journal(self) -> Arrays:
        """The states met since the last journal."""
        if not self._met:
            return {}
        arrays = {name: np.concatenate([part[name] for part in self._met]) for name in self._met[0]}
        self._met.clear()
        return arrays

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Continues from another trainer's `state`, with the states of its journals."""
        super().restore(state, journals)
        for journal in journals:
            if journal:
                self._add(journal)
        self._met.clear()


class _Pool:
    """The states that one agent has met, with its experts' actions, in one growing array (R, 49)."""

    def __init__(self) -> None:
        self._rows, self._count = np.zeros((1024, policy.STATE + 1), np.float32), 0

    def __len__(self) -> int:
        return self._count

    def add(self, states: np.ndarray, actions: np.ndarray) -> None:
        """Adds states (R, 48) and the experts' actions (R,)."""
        end = self._count + len(states)
        while end > len(self._rows):  # Doubles, so that a row costs the same on average.
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])
        self._rows[self._count : end] = np.column_stack([states, actions])
        self._count = end

    def draw(self, rng: np.random.Generator, updates: int) -> tuple[np.ndarray, np.ndarray]:
        """OWN random states for each update (updates, OWN, 48), and the experts' actions (updates, OWN)."""
        rows = self._rows[rng.integers(self._count, size=(updates, OWN))]
        return rows[..., :-1], rows[..., -1]
