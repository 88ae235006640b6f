"""Optuna's samplers and its median pruner; the only importer of Optuna.

Nothing of Optuna is stored. Each call gives Optuna all earlier trials anew, and a seed that depends on the number of
the trial. So a sweep that was killed continues with the trials that an unbroken one would have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dextron_bench.errors import MissingPackage
from dextron_bench.sweeps.space import Choices, Range, Space
from dextron_bench.sweeps.trial import DONE, STOPPED, Trial

if TYPE_CHECKING:
    import optuna


class MissingOptuna(MissingPackage):
    """Optuna is not installed."""


def propose(space: Space, sampler: str, seed: Sequence[int], earlier: Sequence[Trial]) -> dict[str, Any]:
    """The settings of the next trial, by the sampler "tpe" or "gp"; raises MissingOptuna."""
    optuna = load()
    number = int(np.random.SeedSequence(seed).generate_state(1)[0])
    samplers = {"tpe": optuna.samplers.TPESampler, "gp": optuna.samplers.GPSampler}
    study = _study(space, earlier, samplers[sampler](seed=number))
    values = study.ask(_distributions(space)).params
    return {name: _value(part, values[name]) for name, part in space.items()}


def should_stop(points: Mapping[int, float], earlier: Sequence[Trial]) -> bool:
    """True if a trial with these mean returns on `val`, by epoch, is below the median of the trials that are done.

    Its best point so far is compared with their points at the same epoch. It is False as long as fewer than five trials
    are done. Raises MissingOptuna.
    """
    optuna = load()
    study = _study({}, earlier)
    running = optuna.trial.create_trial(state=optuna.trial.TrialState.RUNNING, intermediate_values=dict(points))
    return optuna.pruners.MedianPruner().prune(study, running)


def load() -> Any:
    """The module `optuna`, silent; raises MissingOptuna."""
    try:
        import optuna
    except ModuleNotFoundError:
        raise MissingOptuna("this needs Optuna: pip install 'dextron-bench[sweep]'") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna


def _study(space: Space, earlier: Sequence[Trial], sampler: Any = None) -> optuna.Study:
    """A study in memory with the earlier trials that have ended."""
    optuna = load()
    study = optuna.create_study(direction="maximize", sampler=sampler, study_name="sweep")
    states = {DONE: optuna.trial.TrialState.COMPLETE, STOPPED: optuna.trial.TrialState.PRUNED}
    distributions = _distributions(space)
    for trial in earlier:
        state = states.get(trial.state, optuna.trial.TrialState.FAIL)
        study.add_trial(
            optuna.trial.create_trial(
                state=state,
                params={name: _coded(part, trial.settings[name]) for name, part in space.items()},
                distributions=distributions,
                value=trial.score if trial.state == DONE else None,
                intermediate_values=dict(trial.points),
            )
        )
    return study


def _distributions(space: Space) -> dict[str, Any]:
    """A space as Optuna has it; choices are numbers of values, since Optuna takes no values of other types."""
    optuna = load()
    distributions: dict[str, Any] = {}
    for name, part in space.items():
        if isinstance(part, Choices):
            distributions[name] = optuna.distributions.CategoricalDistribution(range(len(part.values)))
        else:
            kind = optuna.distributions.IntDistribution if part.is_whole else optuna.distributions.FloatDistribution
            distributions[name] = kind(part.low, part.high, log=part.log)
    return distributions


def _coded(part: Choices | Range, value: Any) -> Any:
    return part.index(value) if isinstance(part, Choices) else value


def _value(part: Choices | Range, coded: Any) -> Any:
    return part.values[coded] if isinstance(part, Choices) else coded
