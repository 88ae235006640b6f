"""How well the success model foretells episodes that it never saw: of experts and of policies, on a split."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import policies
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.success import metrics
from dextron_bench.success.metrics import Metrics
from dextron_bench.success.network import SuccessModel
from dextron_bench.world import model as world_model

TIME_BINS = 10  # Of a reach, in each of which the AUC is told; what comes after its end is one more.


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The judgement of all transitions, and the AUC (TIME_BINS + 1,) in each tenth of the reach, and after it."""

    overall: Metrics
    auc_by_time: np.ndarray
    calibration: tuple[np.ndarray, np.ndarray, np.ndarray]

    def as_dict(self) -> dict[str, Any]:
        """All of it by name, as JSON has it: no NaN."""
        means, shares, counts = (_plain(values) for values in self.calibration)
        told = {"auc_by_time": _plain(self.auc_by_time), "predicted": means, "observed": shares, "predictions": counts}
        return {name: None if value != value else value for name, value in asdict(self.overall).items()} | told


def with_random_experts(cases: Sequence[Case], seed: int = 0) -> list[Case]:
    """Every case twice: with the expert that solves it, and with one drawn uniformly, so that outcomes differ."""
    rng = np.random.default_rng([seed, len(cases)])
    gains, criticals = (rng.uniform(*bounds, len(cases)) for bounds in (policies.GAIN, policies.CRITICAL_DISTANCE))
    drawn = [Expert(gain, critical) for gain, critical in zip(gains.tolist(), criticals.tolist(), strict=True)]
    return [*cases, *(replace(case, expert=expert) for case, expert in zip(cases, drawn, strict=True))]


def evaluate(
    model: SuccessModel, source: Source, cases: Sequence[Case], agent: Agent | None = None, threads: int = 0
) -> Evaluation:
    """Judges the model on every transition of an agent's episodes, by default of the cases' experts."""
    parts = [_foretold(model, source, episode) for episode in _played(source, cases, agent, threads)]
    chances, outcomes, times = (np.concatenate(column) for column in zip(*parts, strict=True))
    of = np.minimum((times * TIME_BINS).astype(int), TIME_BINS)
    by_time = np.array([metrics.auc(chances[of == part], outcomes[of == part]) for part in range(TIME_BINS + 1)])
    return Evaluation(metrics.evaluate(chances, outcomes), by_time, metrics.calibration(chances, outcomes))


def _plain(values: np.ndarray) -> list[float | None]:
    return [None if value != value else value for value in values.tolist()]


def _played(source: Source, cases: Sequence[Case], agent: Agent | None, threads: int) -> Iterator[Episode]:
    """Episodes in the order of their cases."""
    played = dict(rollout(agent or ExpertAgent(), source, cases, threads=threads))
    yield from (played[k] for k in range(len(cases)))


def _foretold(model: SuccessModel, source: Source, episode: Episode) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chances, outcomes and times, as a share of the reach's duration, of an episode's transitions, each (T,)."""
    chances = model.chance(episode.states[:-1], episode.actions[:, 0])
    times = np.arange(len(chances)) * world_model.CONTROL_STEP / source.duration(episode.setting)
    return chances, np.full(len(chances), int(episode.success)), times
