"""Checks whether an agent can be submitted: plays a few episodes with it in a separate process."""

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
from dextron_bench.scores import cells
from dextron_bench.splits.loading import load_split
from dextron_bench.world import model

EPISODES = 8
STEPS = 50  # First steps of each episode that are repeated among other rows.
CROWD, TIMED_CALLS = 256, 20  # Episodes at once and calls of act(), to measure its duration.
SLOW = 5.0  # [ms] for a step of one episode; the physics takes about 0.3.

OK, MEND, NOTE = "ok", "mend", "note"
FORM = "actions are finite, in [-1, 1], one per row"


@dataclass(frozen=True, slots=True)
class Check:
    """The result of one check: `verdict` is OK, MEND for a fault that prevents a submission, or NOTE for a warning."""

    what: str
    verdict: str
    detail: str


def checks(
    launch: Launch, reaches: str = "synthetic", limits: Limits | None = None, threads: int = 0
) -> Iterator[Check]:
    """Checks an agent on rows of `val`, one check at a time; stops early if the agent does not start or fails."""
    limits = limits or Limits()
    try:
        episodes = _play(launch, reaches, limits, threads)
    except AgentError as error:
        yield Check("it starts", MEND, str(error))
        return
    yield Check("it starts", OK, "it answers as the protocol asks")
    yield _form_check(episodes)
    if any(episode.failure for episode in episodes):
        return
    score = np.mean([episode.score for episode in episodes])
    detail = f"mean return {score:.1f} of 20 in {len(episodes)} episodes of val"
    yield Check("it grasps", OK, detail) if score else Check("it never grasps", NOTE, detail)
    yield _determinism_check(episodes, _play(launch, reaches, limits, threads))
    yield _independence_check(launch, episodes, limits)
    yield from _cost_checks(launch, episodes, limits)


def _play(launch: Launch, reaches: str, limits: Limits, threads: int) -> list[Episode]:
    rows = load_split(reaches, "val").first(EPISODES)
    with IsolatedAgent(launch, 0, limits) as agent:
        episodes = dict(rollout(agent, sources.open_source(reaches), rows, threads=threads))
    return [episodes[place] for place in range(len(rows))]


def _form_check(episodes: Sequence[Episode]) -> Check:
    if failures := [episode.failure for episode in episodes if episode.failure]:
        return Check(FORM, MEND, f"{cells.counted(len(failures), 'episode')} failed: {failures[0]}")
    largest = max(float(np.abs(episode.actions).max()) for episode in episodes)
    return Check(FORM, OK, f"the largest is {largest:.3g}")


def _determinism_check(first: Sequence[Episode], second: Sequence[Episode]) -> Check:
    """Whether two runs with the same seed chose the same actions."""
    what = "it is deterministic under a seed"
    if all(np.array_equal(a.actions, b.actions) for a, b in zip(first, second, strict=True)):
        return Check(what, OK, "a second run gives the same episodes")
    return Check(what, MEND, "a second run with the same seed acts differently: seed all random numbers")


def _independence_check(launch: Launch, episodes: Sequence[Episode], limits: Limits) -> Check:
    """Whether the actions of an episode depend on the other rows of the batch, or on their order."""
    what = "actions do not depend on other rows"
    steps = min(STEPS, *(len(episode.actions) for episode in episodes))
    states = np.stack([episode.states[:steps] for episode in episodes], axis=1)  # (T, N, 48)
    actions = np.stack([episode.actions[:steps] for episode in episodes], axis=1)
    order = np.random.default_rng(0).permutation(len(episodes))[: max(1, len(episodes) // 2)]
    with IsolatedAgent(launch, 0, limits) as agent:
        agent.reset(np.arange(len(order)))
        try:
            repeated = np.stack([np.clip(agent.act(batch[order]), -1.0, 1.0) for batch in states])
        except (AgentCrashed, AgentError) as error:
            return Check(what, MEND, f"with {len(order)} episodes instead of {len(episodes)}: {error}")
    worst = float(np.abs(repeated - actions[:, order]).max())
    if worst == 0.0:
        return Check(what, OK, "half of the episodes, in another order, get bit-equal actions")
    detail = (
        f"in another batch they differ by up to {worst:.2g}, which can change outcomes; see dextron_bench.Perceptron"
    )
    return Check(what, NOTE, detail)


def _cost_checks(launch: Launch, episodes: Sequence[Episode], limits: Limits) -> Iterator[Check]:
    """The duration of a step when many episodes are played at once, and the memory that this needs."""
    what = "it is fast enough"
    states = np.resize(np.concatenate([episode.states for episode in episodes]), (CROWD, model.STATE))
    with IsolatedAgent(launch, 0, limits) as agent:
        agent.reset(np.arange(CROWD))
        try:
            agent.act(states)
            start = time.perf_counter()
            for _ in range(TIMED_CALLS):
                agent.act(states)
        except (AgentCrashed, AgentError) as error:
            yield Check(what, MEND, f"with {CROWD} episodes at once: {error}")
            return
        duration = 1e3 * (time.perf_counter() - start) / (TIMED_CALLS * CROWD)  # [ms]
        agent.close()
        peak = agent.peak
    yield Check(what, OK if duration < SLOW else NOTE, f"{duration:.3f} ms for a step of one episode, among {CROWD}")
    mebibytes = f"{peak / 2**20:.0f} MiB of at most {limits.memory / 2**20:.0f}"
    detail = mebibytes if peak else "this system does not report it"
    yield Check("it needs little memory", OK if peak < limits.memory / 2 else NOTE, detail)
