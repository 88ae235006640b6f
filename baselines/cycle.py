"""The training loop of the paper: one agent step, one expert step, one update; S seeds train together.

The file is longer than 200 lines because one class holds the whole state of a training that can be resumed exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor

from baselines import demonstrations
from baselines.normalise import CLIP, Moments
from baselines.policy import STATE
from baselines.replay import Replay, Transitions
from baselines.sac import BATCH, Batch, Sac
from baselines.schedule import Exploration, Schedule
from dextron_bench import Case, Track
from dextron_bench.methods.learners import Arrays
from dextron_bench.world.engine import Engine

CAPACITY = 1_000_000  # Transitions in either buffer (table II).
FRAMES = 1000  # Control steps of the agent in an epoch.

# The random streams of each seed.
NETWORKS, EPISODES, DEMONSTRATIONS, ACTING, WARM_START, BATCHES, NOISE, HOLDING = range(8)


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


class Cycle:
    """The Trainer of RL and RLIL: trains S agents by SAC; each batch has a share of demonstrations.

    RLPD replaces the networks, the choice of demonstrations, the scale of rewards, and what is drawn and learned at a
    frame: `_make_networks`, `_load_demonstrations`, `_select_demonstrations`, `_scaled_rewards`, `_draw`, `_update`.
    """

    losses = "action_value_loss", "value_loss", "policy_loss"  # What an update returns for each agent.

    def __init__(
        self,
        track: Track,
        seeds: Sequence[int],
        schedule: Schedule,
        demonstrated: int,
        exploration: Exploration = Exploration(),  # noqa: B008 (frozen)
        critics: int = 1,
    ) -> None:
        """Trains one agent per seed, with `critics` Q; `demonstrated` of the BATCH transitions come from experts."""
        self.epoch = 0
        self._track, self._seeds, self._schedule, self._exploration = track, list(seeds), schedule, exploration
        self._demonstrated, self._frames = demonstrated, 0
        agents = len(self._seeds)
        self._sac = self._make_networks([self._rng(seed, NETWORKS) for seed in seeds], critics)
        self._states, self._rewards = Moments(agents, STATE), Moments(agents, 1)
        self._replay = Replay(agents, CAPACITY + CAPACITY // 16)
        self._ids = np.arange(agents)
        self._engine = Engine(agents, track.threads)
        self._episodes = np.zeros(agents, int)
        self._score = np.zeros(agents)
        self._noise, self._length, self._holds = np.zeros((agents, 1)), np.zeros(agents, int), np.zeros(agents, bool)
        self._recent: list[tuple[Transitions, np.ndarray]] = []
        if demonstrated:
            self._load_demonstrations()
        self._now = self._begin(self._ids)

    def _make_networks(self, rngs: Sequence[np.random.Generator], critics: int) -> Networks:
        """The networks of each agent, drawn from its own generator."""
        return Sac(rngs, self._track.device, critics)

    def _load_demonstrations(self) -> None:
        """Loads the demonstrations, and draws the order in which each seed's expert plays them."""
        self._demos, length = demonstrations.load(self._track, self._schedule.episodes), self._schedule.epochs * FRAMES
        streams = [self._demos.stream(self._rng(seed, DEMONSTRATIONS), length) for seed in self._seeds]
        self._stream = np.stack(streams)

    def advance(self) -> list[dict[str, float]]:
        """Trains for FRAMES cycles; returns each seed's losses, number of finished episodes and their mean return."""
        acting, random = self._normal(ACTING, 1), self._uniform(WARM_START, 1) * 2.0 - 1.0
        draws = self._draw()
        losses: list[Tensor] = []
        scores: list[list[float]] = [[] for _ in self._seeds]
        for t in range(FRAMES):
            is_warm = self._frames >= self._schedule.warm_start
            noise_now = self._hold(acting[t] if is_warm else random[t], everywhere=not is_warm)
            self._step(self._act(noise_now) if is_warm else noise_now, scores)
            if is_warm or self._frames >= self._first_update:
                losses.append(self._update([draw[t] for draw in draws]))
        self.epoch += 1
        return self._metrics(losses, scores)

    def _draw(self) -> tuple[Any, ...]:
        """The random numbers of this epoch's updates, arrays or tensors (FRAMES, S, ...)."""
        return self._uniform(BATCHES, BATCH), self._tensor(self._normal(NOISE, BATCH)[..., None])

    def _update(self, drawn: Sequence[Any]) -> Tensor:
        """The update of a frame, with its random numbers (S, ...); returns the losses (n, S)."""
        uniform, noise = drawn
        assert isinstance(self._sac, Sac)
        return self._sac.update(self._batch(uniform), noise)

    @property
    def _first_update(self) -> int:
        """Frames before the first update: the warm start, or one batch if the noise is held."""
        return self._schedule.warm_start if self._exploration.hold == 1 else BATCH

    def weights(self) -> list[Arrays]:
        """The policy's layers, and `mean` and `deviation` of states, for each seed."""
        layers = [parameter.detach().cpu().numpy() for parameter in self._sac.policy]
        return [
            {f"policy.{i}": layer[k].copy() for i, layer in enumerate(layers)}
            | {"mean": self._states.mean[k].copy(), "deviation": self._states.deviation[k].copy()}
            for k in self._ids
        ]

    def state(self) -> Arrays:
        """Networks, optimiser, scales, and the current episodes."""
        arrays = {name: array.copy() for name, array in self._arrays().items()}
        arrays |= {f"sac.{name}": array for name, array in self._sac.save().items()}
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
        self._sac.load({name.removeprefix("sac."): array for name, array in state.items() if name.startswith("sac.")})
        paths = [
            self._track.source.path(self._case(k, int(self._episodes[k]) - 1).setting) for k in range(len(self._ids))
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
            draw = self._rng(self._seeds[k], HOLDING, int(self._episodes[k])).random()
            self._holds[k] = draw < self._exploration.share
        self._length[agents] = 0
        self._episodes[agents] += 1
        return self._engine.begin(agents, [self._track.source.path(case.setting) for case in cases])

    def _case(self, agent: int, episode: int) -> Case:
        """The case of an agent's episode, by its number."""
        rng = self._rng(self._seeds[agent], EPISODES, episode)
        return self._track.cases[int(rng.integers(len(self._track.cases)))]

    def _act(self, noise: np.ndarray) -> np.ndarray:
        """Sampled actions (S, 1) in the current states."""
        scaled = np.clip((self._now - self._states.mean) / self._states.deviation, -CLIP, CLIP)
        states, noise_now = (self._tensor(array)[:, None] for array in (scaled, noise))
        return self._sac.act(states, noise_now)[:, 0].double().cpu().numpy()

    def _batch(self, uniform: np.ndarray) -> Batch:
        """The scaled transitions that numbers (S, B) in [0, 1) select; demonstrations come first."""
        parts = self._replay.select(uniform[:, self._demonstrated :])
        if self._demonstrated:
            demos = self._select_demonstrations(uniform[:, : self._demonstrated])
            parts = Transitions(*(np.concatenate(pair, axis=1) for pair in zip(demos, parts, strict=True)))
        scale = self._states.mean, self._states.deviation
        mean, deviation = (array[:, None].astype(np.float32) for array in scale)
        both = np.concatenate([parts.states, parts.nexts], axis=1)
        scaled = self._tensor((both - mean) / deviation).clamp_(-CLIP, CLIP)
        columns = (parts.actions, self._scaled_rewards(parts.rewards), ~parts.terminated)
        actions, rewards, alive = (self._tensor(array)[..., None] for array in columns)
        size = uniform.shape[1]
        return Batch(scaled[:, :size], actions, rewards, scaled[:, size:], alive)

    def _scaled_rewards(self, rewards: np.ndarray) -> np.ndarray:
        """Rewards (S, B) as the networks learn them."""
        return np.clip(rewards / self._rewards.deviation, -CLIP, CLIP)

    def _select_demonstrations(self, uniform: np.ndarray) -> Transitions:
        """Like `Replay.select`, from the demonstrations streamed so far."""
        oldest = max(self._frames - CAPACITY, 0)
        place = oldest + (uniform * (self._frames - oldest)).astype(int)
        return self._demos.at(self._stream[self._ids[:, None], place])

    def _metrics(self, losses: list[Tensor], scores: list[list[float]]) -> list[dict[str, float]]:
        metrics: list[dict[str, float]] = [{"frames": self._frames, "episodes": len(returns)} for returns in scores]
        for values, returns in zip(metrics, scores, strict=True):
            values |= {"score": float(np.mean(returns))} if returns else {}
        if losses:
            means = torch.stack(losses).mean(dim=0).double().cpu().numpy()
            for k, values in enumerate(metrics):
                values |= dict(zip(self.losses, means[:, k].tolist(), strict=True))
        return metrics

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.tensor(array, dtype=torch.float32, device=self._track.device)

    def _rng(self, seed: int, *stream: int) -> np.random.Generator:
        return np.random.default_rng([seed, *stream])

    def _uniform(self, stream: int, width: int) -> np.ndarray:
        """Uniform numbers (FRAMES, S, width) in [0, 1) for this epoch, from one stream of each seed."""
        draws = [self._rng(seed, stream, self.epoch).random((FRAMES, width)) for seed in self._seeds]
        return np.stack(draws, axis=1)

    def _normal(self, stream: int, width: int) -> np.ndarray:
        """Standard normal numbers (FRAMES, S, width) for this epoch, from one stream of each seed."""
        draws = [self._rng(seed, stream, self.epoch).standard_normal((FRAMES, width)) for seed in self._seeds]
        return np.stack(draws, axis=1)
