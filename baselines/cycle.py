"""The training loop of the paper: one agent step, one expert step, one update; S seeds train together.

The file is longer than 200 lines because one class holds the whole state of a training that can be resumed exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from baselines.normalise import CLIP, Moments
from baselines.policy import STATE
from baselines.random_streams import ACTING, EPISODES, HOLDING, NETWORKS, WARM_START, Draws, generator
from baselines.replay import CAPACITY, Replay, Transitions
from baselines.sac import BATCH, Batch
from baselines.schedule import Exploration, Schedule
from dextron_bench import Case, TrainingSetup
from dextron_bench.methods.learners import Arrays
from dextron_bench.world.engine import Engine

FRAMES = 1000  # Control steps of the agent in an epoch.


class Networks(Protocol):
    """The networks of S agents, with their optimisers."""

    @property
    def policy(self) -> list[Tensor]:
        """The policies' parameters, as in `Stack`."""
        ...

    def act(self, states: Tensor, noise: Tensor) -> Tensor:
        """Sampled actions (S, B, 1) in scaled states (S, B, 48) for standard normal noise (S, B, 1)."""
        ...

    def save(self) -> dict[str, np.ndarray]:
        """Copies of everything that training changes, by name."""
        ...

    def load(self, saved: Mapping[str, np.ndarray]) -> None:
        """Restores the arrays that `save` returned."""
        ...


class Algorithm(Protocol):
    """How the networks learn from batches of transitions."""

    @property
    def losses(self) -> tuple[str, ...]:
        """Names of what an update returns for each agent."""
        ...

    @property
    def scales_rewards(self) -> bool:
        """True if rewards are divided by their deviation so far."""
        ...

    @property
    def networks(self) -> Networks:
        """The networks that learn."""
        ...

    def draw(self, draws: Draws) -> tuple[Any, ...]:
        """The random numbers of an epoch's updates, arrays or tensors (FRAMES, S, ...)."""
        ...

    def update(self, batch: Callable[[np.ndarray], Batch], drawn: Sequence[Any]) -> Tensor:
        """Learns at a frame, with its random numbers (S, ...); returns the losses (n, S).

        `batch` gives the scaled transitions that numbers (S, B) in [0, 1) select.
        """
        ...


class Demonstrations(Protocol):
    """Transitions of experts."""

    def select(self, uniform: np.ndarray, frames: int) -> Transitions:
        """The transitions (S, B) that numbers (S, B) in [0, 1) select after so many frames."""
        ...


class Cycle:
    """The Trainer of RL, RLIL and RLPD: S agents act, keep what they met, and learn from it and from demonstrations."""

    def __init__(
        self,
        setup: TrainingSetup,
        seeds: Sequence[int],
        schedule: Schedule,
        algorithm: Callable[[Sequence[np.random.Generator], str], Algorithm],
        demonstrations: Demonstrations | None = None,
        demonstrated: int = 0,
        exploration: Exploration = Exploration(),  # noqa: B008 (frozen)
    ) -> None:
        """Trains one agent per seed; the first `demonstrated` transitions of each batch come from experts.

        `algorithm` takes a generator for each agent's networks, and the device.
        """
        self.epoch = 0
        self._setup, self._seeds, self._schedule, self._exploration = setup, list(seeds), schedule, exploration
        self._demonstrations, self._demonstrated, self._frames = demonstrations, demonstrated, 0
        agents = len(self._seeds)
        self._algorithm = algorithm([generator(seed, NETWORKS) for seed in seeds], setup.device)
        self._networks = self._algorithm.networks
        self._states, self._rewards = Moments(agents, STATE), Moments(agents, 1)
        self._replay = Replay(agents, CAPACITY + CAPACITY // 16)
        self._ids = np.arange(agents)
        self._engine = Engine(agents, setup.threads)
        self._episodes = np.zeros(agents, int)
        self._score = np.zeros(agents)
        self._noise, self._length, self._holds = np.zeros((agents, 1)), np.zeros(agents, int), np.zeros(agents, bool)
        self._recent: list[tuple[Transitions, np.ndarray]] = []
        self._now = self._begin(self._ids)

    def advance(self) -> list[dict[str, float]]:
        """Trains for FRAMES cycles; returns each seed's losses, number of finished episodes and their mean return."""
        draws = Draws(self._seeds, self.epoch, FRAMES)
        acting, random = draws.normal(ACTING, 1), draws.uniform(WARM_START, 1) * 2.0 - 1.0
        drawn = self._algorithm.draw(draws)
        losses: list[Tensor] = []
        scores: list[list[float]] = [[] for _ in self._seeds]
        for t in range(FRAMES):
            is_random = self._frames < self._schedule.warm_start
            noise_now = self._hold(random[t] if is_random else acting[t], everywhere=is_random)
            self._step(noise_now if is_random else self._act(noise_now), scores)
            if not is_random or self._frames >= self._first_update:
                losses.append(self._algorithm.update(self._batch, [numbers[t] for numbers in drawn]))
        self.epoch += 1
        return self._metrics(losses, scores)

    @property
    def _first_update(self) -> int:
        """Frames before the first update: the warm start, or one batch if the noise is held."""
        return self._schedule.warm_start if self._exploration.hold == 1 else BATCH

    def weights(self) -> list[Arrays]:
        """The policy's layers, and `mean` and `deviation` of states, for each seed."""
        layers = [parameter.detach().cpu().numpy() for parameter in self._networks.policy]
        return [
            {f"policy.{i}": layer[k].copy() for i, layer in enumerate(layers)}
            | {"mean": self._states.mean[k].copy(), "deviation": self._states.deviation[k].copy()}
            for k in self._ids
        ]

    def state(self) -> Arrays:
        """Networks, optimiser, scales, and the current episodes."""
        arrays = {name: array.copy() for name, array in self._arrays().items()}
        arrays |= {f"sac.{name}": array for name, array in self._networks.save().items()}
        arrays |= {f"engine.{name}": array for name, array in self._engine.save(self._ids).items()}
        return arrays | {"done": np.array([self.epoch, self._frames])}

    def journal(self) -> Arrays:
        """Transitions since the last journal; a next state is stored only if it is not the state of the next row."""
        if not self._recent:
            return {}
        steps = Transitions(*(np.stack(part) for part in zip(*(step for step, _ in self._recent), strict=True)))
        ended = np.stack([ended for _, ended in self._recent])
        self._recent.clear()
        arrays = steps._asdict() | {"terminated": steps.terminated.astype(np.uint8), "ended": ended.astype(np.uint8)}
        del arrays["nexts"]
        return arrays | {"finals": steps.nexts[ended], "last": steps.nexts[-1]}

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Continues from another trainer's `state`; fills the replay buffer again from its journals."""
        for name, array in self._arrays().items():
            array[...] = state[name]
        self._networks.load(
            {name.removeprefix("sac."): array for name, array in state.items() if name.startswith("sac.")}
        )
        paths = [
            self._setup.source.path(self._case(k, int(self._episodes[k]) - 1).setting) for k in range(len(self._ids))
        ]
        self._engine.begin(self._ids, paths)
        self._engine.load(
            self._ids,
            {name.removeprefix("engine."): array for name, array in state.items() if name.startswith("engine.")},
        )
        self.epoch, self._frames = (int(number) for number in state["done"])
        for journal in journals:
            self._add_journal(journal)
        self._recent.clear()

    def _add_journal(self, journal: Arrays) -> None:
        terminated, ended = journal["terminated"].astype(bool), journal["ended"].astype(bool)
        nexts = np.concatenate([journal["states"][1:], journal["last"][None]])
        nexts[ended] = journal["finals"]
        steps = Transitions(journal["states"], journal["actions"], journal["rewards"], nexts, terminated)
        for t in range(len(ended)):
            self._replay.add(Transitions(*(part[t] for part in steps)), ended[t])

    def _arrays(self) -> Arrays:
        """The arrays that training changes in place, by name."""
        scales = {"states": self._states, "rewards": self._rewards}
        arrays = {f"{key}.{name}": array for key, moments in scales.items() for name, array in vars(moments).items()}
        arrays |= {"noise": self._noise, "length": self._length, "holds": self._holds}
        return arrays | {"now": self._now, "score": self._score, "episodes": self._episodes}

    def _hold(self, fresh: np.ndarray, everywhere: bool) -> np.ndarray:
        """The exploration noise (S, 1) of this step: `fresh`, or the noise that an episode holds."""
        renewed = ~(self._holds | everywhere) | (self._length % self._exploration.hold == 0)
        self._noise[renewed] = fresh[renewed]
        return self._noise.copy()

    def _step(self, actions: np.ndarray, scores: list[list[float]]) -> None:
        """Plays actions (S, 1) and stores the transitions; adds the returns of finished episodes to `scores`."""
        self._states.update(self._now)
        step = self._engine.step(self._ids, actions)
        ended = step.ended
        self._rewards.update(step.rewards[:, None])
        before, taken, rewards, after = (
            array.astype(np.float32) for array in (self._now, actions[:, 0], step.rewards, step.states)
        )
        transitions = Transitions(before, taken, rewards, after, step.terminated)
        self._replay.add(transitions, ended)
        self._recent.append((transitions, ended))
        self._frames += 1
        self._length += 1
        self._score += step.rewards
        self._now[:] = step.states
        if ended.any():
            for k in np.flatnonzero(ended):
                scores[k].append(float(self._score[k]))
            self._score[ended] = 0.0
            self._now[ended] = self._begin(self._ids[ended])

    def _begin(self, agents: np.ndarray) -> np.ndarray:
        """Starts the next episode of each agent of `agents` (n,); returns the first states (n, 48)."""
        cases = [self._case(int(k), int(self._episodes[k])) for k in agents]
        for k in agents:
            draw = generator(self._seeds[k], HOLDING, int(self._episodes[k])).random()
            self._holds[k] = draw < self._exploration.share
        self._length[agents] = 0
        self._episodes[agents] += 1
        return self._engine.begin(agents, [self._setup.source.path(case.setting) for case in cases])

    def _case(self, agent: int, episode: int) -> Case:
        """The case of an agent's episode, by its number."""
        rng = generator(self._seeds[agent], EPISODES, episode)
        return self._setup.cases[int(rng.integers(len(self._setup.cases)))]

    def _act(self, noise: np.ndarray) -> np.ndarray:
        """Sampled actions (S, 1) in the current states."""
        scaled = np.clip((self._now - self._states.mean) / self._states.deviation, -CLIP, CLIP)
        states, noise_now = (self._tensor(array)[:, None] for array in (scaled, noise))
        return self._networks.act(states, noise_now)[:, 0].double().cpu().numpy()

    def _batch(self, uniform: np.ndarray) -> Batch:
        """The scaled transitions that numbers (S, B) in [0, 1) select; demonstrations come first."""
        parts = self._replay.select(uniform[:, self._demonstrated :])
        if self._demonstrations:
            demos = self._demonstrations.select(uniform[:, : self._demonstrated], self._frames)
            parts = Transitions(*(np.concatenate(pair, axis=1) for pair in zip(demos, parts, strict=True)))
        scale = self._states.mean, self._states.deviation
        mean, deviation = (array[:, None].astype(np.float32) for array in scale)
        both = np.concatenate([parts.states, parts.nexts], axis=1)
        scaled = self._tensor((both - mean) / deviation).clamp_(-CLIP, CLIP)
        rewards = parts.rewards
        if self._algorithm.scales_rewards:
            rewards = np.clip(rewards / self._rewards.deviation, -CLIP, CLIP)
        columns = (parts.actions, rewards, ~parts.terminated)
        actions, rewards_now, alive = (self._tensor(array)[..., None] for array in columns)
        size = uniform.shape[1]
        return Batch(scaled[:, :size], actions, rewards_now, scaled[:, size:], alive)

    def _metrics(self, losses: list[Tensor], scores: list[list[float]]) -> list[dict[str, float]]:
        metrics: list[dict[str, float]] = [{"frames": self._frames, "episodes": len(returns)} for returns in scores]
        for values, returns in zip(metrics, scores, strict=True):
            values |= {"score": float(np.mean(returns))} if returns else {}
        if losses:
            means = torch.stack(losses).mean(dim=0).double().cpu().numpy()
            for k, values in enumerate(metrics):
                values |= dict(zip(self._algorithm.losses, means[:, k].tolist(), strict=True))
        return metrics

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.tensor(array, dtype=torch.float32, device=self._setup.device)
