"""Compares the success model's predictions with the outcomes of episodes that it was not trained on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import policies
from dextron_bench.experts.policies import Expert, ExpertAgent
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.rows import Rows
from dextron_bench.success import metrics
from dextron_bench.success.metrics import Metrics
from dextron_bench.success.network import SuccessModel
from dextron_bench.world.model import CONTROL_STEP

TIME_BINS = 10  # Parts of a reach, each with an AUC of its own; the time after the reach is one more part.


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Metrics over all transitions, the AUC (TIME_BINS + 1,) by part of the reach, and the calibration curve."""

    overall: Metrics
    auc_by_time: np.ndarray
    calibration: tuple[np.ndarray, np.ndarray, np.ndarray]

    def as_dict(self) -> dict[str, Any]:
        """All values by name, for JSON: None replaces NaN."""
        means, shares, counts = (_without_nan(values) for values in self.calibration)
        overall = {name: None if math.isnan(value) else value for name, value in asdict(self.overall).items()}
        curves = {"auc_by_time": _without_nan(self.auc_by_time), "predicted": means, "observed": shares}
        return overall | curves | {"predictions": counts}


def with_random_experts(rows: Rows, seed: int = 0) -> Rows:
    """Every row with the expert that solves it, then every row with a uniformly drawn expert: outcomes differ."""
    rng = np.random.default_rng([seed, len(rows)])
    gains, criticals = (rng.uniform(*bounds, len(rows)) for bounds in (policies.GAIN, policies.CRITICAL_DISTANCE))
    experts = [Expert(gain, critical) for gain, critical in zip(gains.tolist(), criticals.tolist(), strict=True)]
    drawn = (replace(case, expert=expert) for case, expert in zip(rows.cases, experts, strict=True))
    return Rows(cases=(*rows.cases, *drawn), track=rows.track, bottles=2 * rows.bottles)


def evaluate(
    model: SuccessModel, source: Source, rows: Rows, agent: Agent | None = None, threads: int = 0
) -> Evaluation:
    """Evaluates the model on every transition of an agent's episodes; without an agent, the rows' experts play."""
    columns = [_predict(model, source, episode) for episode in _play(source, rows, agent, threads)]
    chances, outcomes, times = (np.concatenate(column) for column in zip(*columns, strict=True))
    bins = np.minimum((times * TIME_BINS).astype(int), TIME_BINS)
    by_time = np.array([metrics.auc(chances[bins == k], outcomes[bins == k]) for k in range(TIME_BINS + 1)])
    return Evaluation(metrics.evaluate(chances, outcomes), by_time, metrics.calibration(chances, outcomes))


def _without_nan(values: np.ndarray) -> list[float | None]:
    return [None if math.isnan(value) else value for value in values.tolist()]


def _play(source: Source, rows: Rows, agent: Agent | None, threads: int) -> Iterator[Episode]:
    """Episodes in the order of their rows."""
    episodes = dict(rollout(agent or ExpertAgent(), source, rows, threads=threads))
    yield from (episodes[row] for row in range(len(rows)))


def _predict(model: SuccessModel, source: Source, episode: Episode) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chances, outcomes and times (as a share of the reach's duration) of an episode's transitions, each (T,)."""
    chances = model.chance(episode.states[:-1], episode.actions[:, 0])
    times = np.arange(len(chances)) * CONTROL_STEP / source.duration(episode.setting)
    return chances, np.full(len(chances), int(episode.success)), times
