"""Agents in files, and the episodes that they play in a process of their own."""

from __future__ import annotations

from pathlib import Path

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case
from dextron_bench.methods.isolation.isolated_agent import IsolatedAgent, Limits
from dextron_bench.methods.isolation.launch import prepare_launch
from dextron_bench.splits.loading import cases_from_frame
from tests.helpers.short_reaches import SOURCE
from tests.helpers.tiny_benchmark import ROWS

CASES: list[Case] = cases_from_frame(ROWS[:3])
AGENT = """
import time

import numpy as np
from dextron_bench.world import task

class Agent:
    name = "mine"
    rng = np.random.default_rng()

    def agent(self, seed):
        return self

    def reset(self, episodes):
        pass

    def act(self, states):
        {act}
"""
CLOSES = "return np.where(task.distance(states) < 0.06, 1.0, -1.0)[:, None]"


def write_agent(folder: Path, act: str) -> str:
    """Writes an agent whose `act` is one line into a folder; returns its spec."""
    file = folder / "mine.py"
    file.write_text(AGENT.format(act=act))
    return f"{file}:Agent"


def play(spec: str, cases: list[Case] = CASES, **limits: float) -> list[Episode]:
    """The episodes of the cases, in their order; an agent in a process of its own plays two at once."""
    with IsolatedAgent(prepare_launch(spec, trust=True), limits=Limits(**limits)) as agent:  # pyright: ignore[reportArgumentType]
        episodes = dict(rollout(agent, SOURCE, cases, slots=2, threads=1))
    return [episodes[index] for index in range(len(cases))]
