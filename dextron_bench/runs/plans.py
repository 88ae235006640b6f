"""What to run: a plan for a method, a source of reaches and a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dextron_bench.methods import registry
from dextron_bench.methods import weights as methods_weights
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.methods.registry import Entrant
from dextron_bench.training import jobs


@dataclass(frozen=True, slots=True)
class Plan:
    """What to run: a method on a source's splits with one seed; the first `record` episodes of each are recorded.

    `settings` are the method's own. Where `weights` is a file, the method acts with them and trains nothing.
    """

    method: str
    reaches: str
    splits: tuple[str, ...]
    seed: int
    record: int = 0
    settings: Mapping[str, Any] = field(default_factory=dict)
    weights: Path | None = None

    def make(self) -> Entrant:
        """The method for its source of reaches; raises UnknownMethod, BadSettings, AgentError."""
        return registry.create(self.method, self.settings, self.reaches)

    def folder(self, runs: Path) -> Path:
        """Where the run lives."""
        return runs / self.label / self.source / f"seed{self.seed}"

    def course(self, runs: Path, threads: int = 0, device: str = "cpu") -> jobs.TrainingJob | None:
        """The training that its method or its source_policy needs; None where nothing is trained."""
        method = self.make()
        learner = method.source_policy if isinstance(method, PolicyTransfer) else method
        if not isinstance(learner, Learner) or self.weights:
            return None
        return jobs.TrainingJob(learner, registry.run_source(learner, self.reaches), runs, threads, device)

    @property
    def source(self) -> str:
        """The source of reaches that the run is on."""
        return registry.run_source(self.make(), self.reaches)

    @property
    def label(self) -> str:
        """What the run's row is called."""
        return registry.label(self.make())

    def config(self) -> dict[str, Any]:
        """What the run depends on."""
        return registry.config(self.make(), self.source, self.seed)


def shipped(plan: Plan, seeds: Sequence[int]) -> list[Plan]:
    """The plan with the weights that ship, for these seeds or, where there are none, for all; raises MissingWeights."""
    method = plan.make()
    learner = method.source_policy if isinstance(method, PolicyTransfer) else method
    if not isinstance(learner, Learner):
        raise methods_weights.MissingWeights(f"method {method.name!r} has no weights: `dextron-bench run` evaluates it")
    found = methods_weights.shipped(learner, registry.run_source(learner, plan.reaches))
    if lost := [seed for seed in seeds or (0,) if seed not in found and (seeds or not found)]:
        others = methods_weights.labels(learner, registry.run_source(learner, plan.reaches))
        raise methods_weights.MissingWeights(
            f"no weights of {plan.label!r} on {plan.reaches} reaches ship for seed {lost[0]}; train them with "
            f"`dextron-bench run {registry.words(plan.method, plan.settings)} --reaches {plan.reaches} "
            f"--seed {lost[0]}`" + (f", or take what ships: {', '.join(others)}" if others else "")
        )
    return [replace(plan, seed=seed, weights=found[seed]) for seed in seeds or found]
