"""What an agent must do to be played, and what it had better do: tried on a few episodes, isolated."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.agents import AgentCrashed, AgentError
from dextron_bench.methods.isolation.isolated_agent import IsolatedAgent, Limits
from dextron_bench.methods.isolation.launch import Launch
from dextron_bench.reaches import sources
from dextron_bench.splits.loading import load_split
from dextron_bench.world import model

EPISODES = 8
STEPS = 50  # Of an episode, that are asked again in other company.
CROWD, TIMED = 256, 20  # Episodes at once, and questions, to time it by.
SLOW = 5.0  # [ms] for an episode's step, about the 0.3 of the physics by which an evaluation is waited for.

OK, MEND, NOTE = "ok", "mend", "note"


@dataclass(frozen=True, slots=True)
class Check:
    """One thing tried: `verdict` is OK, MEND where it must be mended, NOTE where it is well to know."""

    what: str
    verdict: str
    found: str


def checks(how: Launch, reaches: str = "synthetic", limits: Limits | None = None, threads: int = 0) -> Iterator[Check]:
    """Tries an agent on rows of `val`, check by check; ends early where nothing more can be tried."""
    limits = limits or Limits()
    try:
        first = _play(how, reaches, limits, threads)
    except AgentError as error:
        yield Check("it starts", MEND, str(error))
        return
    yield Check("it starts", OK, "it answers as the protocol asks")
    yield _sound(first)
    if any(episode.failure for episode in first):
        return
    score = np.mean([episode.score for episode in first])
    yield Check(
        "it grasps", NOTE if score == 0 else OK, f"mean return {score:.1f} of 20 in {len(first)} episodes of val"
    )
    again = _play(how, reaches, limits, threads)
    same = all(np.array_equal(a.actions, b.actions) for a, b in zip(first, again, strict=True))
    told = (
        "the same episodes again" if same else "another run with the same seed acts otherwise: seed all that it draws"
    )
    yield Check("it is deterministic under a seed", OK if same else MEND, told)
    yield _company(how, first, limits)
    yield from _cost(how, first, limits)


def _play(how: Launch, reaches: str, limits: Limits, threads: int) -> list[Episode]:
    cases = load_split(reaches, "val").cases[:EPISODES]
    with IsolatedAgent(how, 0, limits) as agent:
        found = dict(rollout(agent, sources.open_source(reaches), cases, threads=threads))
    return [found[place] for place in range(len(cases))]


def _sound(episodes: Sequence[Episode]) -> Check:
    failed = [episode.failure for episode in episodes if episode.failure]
    if failed:
        return Check("actions are finite, in [-1, 1], one a row", MEND, f"{len(failed)} episodes failed: {failed[0]}")
    largest = max(float(np.abs(episode.actions).max()) for episode in episodes)
    return Check("actions are finite, in [-1, 1], one a row", OK, f"the largest is {largest:.3g}")


def _company(how: Launch, episodes: Sequence[Episode], limits: Limits) -> Check:
    """Whether an episode's actions depend on which others are played beside it, and in which rows."""
    what = "actions do not depend on other rows"
    steps = min(STEPS, *(len(episode.actions) for episode in episodes))
    states = np.stack([episode.states[:steps] for episode in episodes], axis=1)  # (T, N, 48)
    actions = np.stack([episode.actions[:steps] for episode in episodes], axis=1)
    order = np.random.default_rng(0).permutation(len(episodes))[: max(1, len(episodes) // 2)]
    with IsolatedAgent(how, 0, limits) as agent:
        agent.reset(np.arange(len(order)))
        try:
            found = np.stack([agent.act(now[order]) for now in states])
        except (AgentCrashed, AgentError) as error:
            return Check(what, MEND, f"with {len(order)} episodes in place of {len(episodes)}: {error}")
    worst = float(np.abs(found - actions[:, order]).max())
    if worst == 0.0:
        return Check(what, OK, "half of the episodes, in another order, get the same actions to the last bit")
    told = f"among others they differ by up to {worst:.2g}, which may change outcomes; see dextron_bench.Perceptron"
    return Check(what, NOTE, told)


def _cost(how: Launch, episodes: Sequence[Episode], limits: Limits) -> Iterator[Check]:
    states = np.resize(np.concatenate([episode.states for episode in episodes]), (CROWD, model.STATE))
    with IsolatedAgent(how, 0, limits) as agent:
        agent.reset(np.arange(CROWD))
        try:
            agent.act(states)
            start = time.perf_counter()
            for _ in range(TIMED):
                agent.act(states)
        except (AgentCrashed, AgentError) as error:
            yield Check("it is quick enough", MEND, f"with {CROWD} episodes at once: {error}")
            return
        each = 1e3 * (time.perf_counter() - start) / (TIMED * CROWD)
        agent.close()
        peak = agent.peak
    yield Check(
        "it is quick enough", OK if each < SLOW else NOTE, f"{each:.3f} ms for a step of an episode, among {CROWD}"
    )
    told = f"{peak / 2**20:.0f} MiB of at most {limits.memory / 2**20:.0f}" if peak else "this system does not tell"
    yield Check("it needs little memory", OK if peak < limits.memory / 2 else NOTE, told)
