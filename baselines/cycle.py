"""The paper's cycle: one step of the agent, one of an expert, one update; S seeds side by side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from torch import Tensor

from baselines import demonstrations
from baselines.normalise import CLIP, Moments
from baselines.policy import STATE
from baselines.replay import Replay, Transitions
from baselines.sac import BATCH, Batch, Sac
from baselines.schedule import Schedule
from dextron_bench import Case, Track
from dextron_bench.methods.learners import Arrays
from dextron_bench.world.engine import Engine

CAPACITY = 1_000_000  # Transitions in either buffer (table II).
FRAMES = 1000  # Control steps of the agent in an epoch.

NETWORKS, EPISODES, DEMONSTRATIONS, ACTING, BLIND, PICKS, NOISE = range(7)  # Streams of random numbers of a seed.


class Cycle:
    """The training of S agents by SAC, each batch with a share of demonstrations; a `learning.Trainer`."""

    def __init__(self, track: Track, seeds: Sequence[int], schedule: Schedule, demonstrated: int) -> None:
        """Trains one agent a seed; `demonstrated` of the BATCH transitions of each update are an expert's."""
        self.epoch = 0
        self._track, self._seeds, self._schedule = track, list(seeds), schedule
        self._demonstrated, self._frames = demonstrated, 0
        agents = len(self._seeds)
        self._sac = Sac([self._rng(seed, NETWORKS) for seed in seeds], track.device)
        self._states, self._rewards = Moments(agents, STATE), Moments(agents, 1)
        self._replay = Replay(agents, CAPACITY + CAPACITY // 16)
        self._ids = np.arange(agents)
        self._engine = Engine(agents, track.threads)
        self._episodes = np.zeros(agents, int)
        self._score = np.zeros(agents)
        self._lived: list[tuple[Transitions, np.ndarray]] = []
        if demonstrated:
            self._demos = demonstrations.load(track, schedule.episodes)
            length = schedule.epochs * FRAMES
            self._stream = np.stack([self._demos.stream(self._rng(seed, DEMONSTRATIONS), length) for seed in seeds])
        self._now = self._begin(self._ids)

    def advance(self) -> list[dict[str, float]]:
        """One epoch of FRAMES cycles; notes losses, and the agents' own episodes and their mean sum of rewards."""
        acting, blind = self._normal(ACTING, 1), self._uniform(BLIND, 1) * 2.0 - 1.0
        picks = self._uniform(PICKS, BATCH)
        noise = torch.tensor(self._normal(NOISE, BATCH)[..., None], dtype=torch.float32, device=self._track.device)
        losses: list[Tensor] = []
        scores: list[list[float]] = [[] for _ in self._seeds]
        for t in range(FRAMES):
            warm = self._frames >= self._schedule.warm_start
            self._live(self._act(acting[t]) if warm else blind[t], scores)
            if warm:
                losses.append(self._sac.update(self._batch(picks[t]), noise[t]))
        self.epoch += 1
        return self._notes(losses, scores)

    def weights(self) -> list[Arrays]:
        """Of each seed: the policy's layers, and `mean` and `deviation` of states."""
        layers = [parameter.detach().cpu().numpy() for parameter in self._sac.policy.parameters]
        return [
            {f"policy.{i}": layer[k].copy() for i, layer in enumerate(layers)}
            | {"mean": self._states.mean[k].copy(), "deviation": self._states.deviation[k].copy()}
            for k in self._ids
        ]

    def state(self) -> Arrays:
        """Networks, optimiser, scales, and the episodes under way."""
        found = {name: array.copy() for name, array in self._arrays().items()}
        found |= {f"sac.{name}": array for name, array in self._sac.save().items()}
        found |= {f"engine.{name}": array for name, array in self._engine.save(self._ids).items()}
        return found | {"done": np.array([self.epoch, self._frames])}

    def journal(self) -> Arrays:
        """The agents' transitions since the last one; next states only where no later row has them."""
        if not self._lived:
            return {}
        lived = Transitions(*(np.stack(part) for part in zip(*(each for each, _ in self._lived), strict=True)))
        ended = np.stack([ended for _, ended in self._lived])
        self._lived.clear()
        found = lived._asdict() | {"terminated": lived.terminated.astype(np.uint8), "ended": ended.astype(np.uint8)}
        del found["nexts"]
        return found | {"finals": lived.nexts[ended], "last": lived.nexts[-1]}

    def restore(self, state: Arrays, journals: Iterable[Arrays]) -> None:
        """Takes the place of the trainer that gave state and journals; the buffer is filled again as it was."""
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
            self._relive(journal)
        self._lived.clear()

    def _relive(self, journal: Arrays) -> None:
        terminated, ended = journal["terminated"].astype(bool), journal["ended"].astype(bool)
        nexts = np.concatenate([journal["states"][1:], journal["last"][None]])
        nexts[ended] = journal["finals"]
        lived = Transitions(journal["states"], journal["actions"], journal["rewards"], nexts, terminated)
        for t in range(len(ended)):
            self._replay.add(Transitions(*(part[t] for part in lived)), ended[t])

    def _arrays(self) -> Arrays:
        """What training changes in place, by name."""
        scales = {"states": self._states, "rewards": self._rewards}
        found = {f"{of}.{name}": array for of, moments in scales.items() for name, array in vars(moments).items()}
        return found | {"now": self._now, "score": self._score, "episodes": self._episodes}

    def _live(self, actions: np.ndarray, scores: list[list[float]]) -> None:
        """Plays actions (S, 1) and keeps what came of them; notes the scores of episodes that ended."""
        self._states.see(self._now)
        step = self._engine.step(self._ids, actions)
        ended = step.ended
        self._rewards.see(step.rewards[:, None])
        before, taken, rewards, after = (
            array.astype(np.float32) for array in (self._now, actions[:, 0], step.rewards, step.states)
        )
        lived = Transitions(before, taken, rewards, after, step.terminated)
        self._replay.add(lived, ended)
        self._lived.append((lived, ended))
        self._frames += 1
        self._score += step.rewards
        self._now[:] = step.states
        if ended.any():
            for k in np.flatnonzero(ended):
                scores[k].append(float(self._score[k]))
            self._score[ended] = 0.0
            self._now[ended] = self._begin(self._ids[ended])

    def _begin(self, agents: np.ndarray) -> np.ndarray:
        """Starts the next episode of each of `agents` (n,); returns first states (n, 48)."""
        cases = [self._case(int(k), int(self._episodes[k])) for k in agents]
        self._episodes[agents] += 1
        return self._engine.begin(agents, [self._track.source.path(case.setting) for case in cases])

    def _case(self, agent: int, episode: int) -> Case:
        """What an agent's episode of that number is played on."""
        rng = self._rng(self._seeds[agent], EPISODES, episode)
        return self._track.cases[int(rng.integers(len(self._track.cases)))]

    def _act(self, noise: np.ndarray) -> np.ndarray:
        """Sampled actions (S, 1) in the states that are now."""
        scaled = np.clip((self._now - self._states.mean) / self._states.deviation, -CLIP, CLIP)
        states, noise_now = (self._tensor(array)[:, None] for array in (scaled, noise))
        return self._sac.act(states, noise_now)[:, 0].double().cpu().numpy()

    def _batch(self, uniform: np.ndarray) -> Batch:
        """The scaled transitions that numbers (S, BATCH) in [0, 1) point at, demonstrations first."""
        parts = self._replay.pick(uniform[:, self._demonstrated :])
        if self._demonstrated:
            demos = self._pick_demonstrations(uniform[:, : self._demonstrated])
            parts = Transitions(*(np.concatenate(pair, axis=1) for pair in zip(demos, parts, strict=True)))
        scale = self._states.mean, self._states.deviation
        mean, deviation = (array[:, None].astype(np.float32) for array in scale)
        both = np.concatenate([parts.states, parts.nexts], axis=1)
        scaled = self._tensor((both - mean) / deviation).clamp_(-CLIP, CLIP)
        rewards = np.clip(parts.rewards / self._rewards.deviation, -CLIP, CLIP)
        columns = (parts.actions, rewards, ~parts.terminated)
        actions, rewards, alive = (self._tensor(array)[..., None] for array in columns)
        return Batch(scaled[:, :BATCH], actions, rewards, scaled[:, BATCH:], alive)

    def _pick_demonstrations(self, uniform: np.ndarray) -> Transitions:
        """As `Replay.pick`, of the demonstrations that have come by so far."""
        oldest = max(self._frames - CAPACITY, 0)
        place = oldest + (uniform * (self._frames - oldest)).astype(int)
        rows = self._stream[self._ids[:, None], place]
        demos = self._demos
        never = np.zeros(rows.shape, bool)
        return Transitions(demos.states[rows], demos.actions[rows], demos.rewards[rows], demos.states[rows + 1], never)

    def _notes(self, losses: list[Tensor], scores: list[list[float]]) -> list[dict[str, float]]:
        notes: list[dict[str, float]] = [{"frames": self._frames, "episodes": len(of)} for of in scores]
        for note, of in zip(notes, scores, strict=True):
            note |= {"score": float(np.mean(of))} if of else {}
        if losses:
            means = torch.stack(losses).mean(dim=0).double().cpu().numpy()
            for k, note in enumerate(notes):
                note |= dict(zip(("action_value_loss", "value_loss", "policy_loss"), means[:, k].tolist(), strict=True))
        return notes

    def _tensor(self, array: np.ndarray) -> Tensor:
        return torch.tensor(array, dtype=torch.float32, device=self._track.device)

    def _rng(self, seed: int, *stream: int) -> np.random.Generator:
        return np.random.default_rng([seed, *stream])

    def _uniform(self, stream: int, width: int) -> np.ndarray:
        """This epoch's numbers in [0, 1), (FRAMES, S, width), from a stream of each seed."""
        draws = [self._rng(seed, stream, self.epoch).random((FRAMES, width)) for seed in self._seeds]
        return np.stack(draws, axis=1)

    def _normal(self, stream: int, width: int) -> np.ndarray:
        """As `_uniform`, standard normal."""
        draws = [self._rng(seed, stream, self.epoch).standard_normal((FRAMES, width)) for seed in self._seeds]
        return np.stack(draws, axis=1)
