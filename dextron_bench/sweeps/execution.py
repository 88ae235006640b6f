"""Executes a sweep: one trial after another, each as an ordinary run on `val`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.methods import registry
from dextron_bench.reaches.recorded.cache import MissingData
from dextron_bench.runs import annotations, execution, result_files
from dextron_bench.runs.plans import Run, beside_other_code, resolve
from dextron_bench.scores import statistics
from dextron_bench.storage import folders
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.sweeps import optuna_search, space
from dextron_bench.sweeps.sweep import VAL, Sweep, SweepFile
from dextron_bench.sweeps.trial import DONE, ENDED, FAILED, STOPPED, Trial
from dextron_bench.training import jobs, learning_curve, loop
from dextron_bench.training.checkpoints import Busy
from dextron_bench.training.learning_curve import CurvePoint
from dextron_bench.world import task

NOT_OF_A_TRIAL = (OSError, MemoryError, Busy, MissingData, jobs.NoDevice, optuna_search.MissingOptuna)
Bar = Callable[[str], AbstractContextManager[Progress]]  # A progress report by its title.


@dataclass(frozen=True)
class Resources:
    """With what a sweep computes: the folder of runs, the threads of the simulation, the device, and what it reports.

    `bar` gives the progress of each trial, and `ended` receives number and content of each trial that has ended.
    """

    runs: Path
    threads: int = 0
    device: str = "cpu"
    bar: Bar = lambda title: nullcontext(no_progress)
    ended: Callable[[int, Trial], None] = lambda number, trial: None


def execute(sweep: Sweep, file: SweepFile, most: int, resources: Resources) -> None:
    """Runs the trials that the file of a sweep lacks; after each it is written again. Failed trials are tried again.

    `most` is the number of trials of a search. Raises BadInput, Failed, the errors that would end every trial
    (NOT_OF_A_TRIAL), and the errors of `Sweep.question`.
    """
    question, flags = sweep.question(), registry.as_flags(sweep.method, sweep.settings)
    if sweep.prune:
        optuna_search.load()
    file.path.parent.mkdir(parents=True, exist_ok=True)
    with folders.locked(file.path.parent, file.path.parent):
        trials = file.begin(question)
        count = sweep.trials(most)
        for number in range(count):
            if number < len(trials) and trials[number].state in ENDED:
                continue
            if number == len(trials):
                trials.append(Trial(sweep.propose(trials)))
            settings = space.restored(sweep.space, trials[number].settings)
            trials[number] = Trial(settings, _run_name(sweep, settings, resources.runs))
            file.write(question, trials, flags)
            with resources.bar(f"trial {number + 1} of {count}") as report:
                trials[number] = _Attempt(sweep, trials[:number], resources, file.name).trial(settings, report)
            file.write(question, trials, flags)
            resources.ended(number, trials[number])


def runs_ahead(sweep: Sweep, file: SweepFile, most: int, runs: Path) -> list[list[Run]]:
    """The runs of all trials that have not ended, a group for each, of a sweep whose trials are independent.

    Trials whose settings the method refuses are left out. Raises BadInput and the errors of `Sweep.question`.
    """
    trials = file.begin(sweep.question())
    trials += [Trial(sweep.propose([Trial({})] * number)) for number in range(len(trials), sweep.trials(most))]
    groups: dict[str, list[Run]] = {}
    for trial in trials:
        settings = space.restored(sweep.space, trial.settings)
        if trial.state not in ENDED and (name := _run_name(sweep, settings, runs)):
            run = beside_other_code(resolve(sweep.plan(settings)), runs)
            groups[name] = [run.with_seed(seed) for seed in sweep.seeds]
    return list(groups.values())


class _Attempt:
    """One attempt at a trial, after the `earlier` ones."""

    def __init__(self, sweep: Sweep, earlier: Sequence[Trial], resources: Resources, tag: str) -> None:
        self._sweep, self._earlier, self._resources, self._tag = sweep, earlier, resources, tag
        self._points: dict[int, float] = {}

    def trial(self, settings: Mapping[str, Any], report: Progress) -> Trial:
        """The trial with its state and its scores; raises the errors that are not of a trial."""
        trial = Trial(settings, _run_name(self._sweep, settings, self._resources.runs))
        try:
            run = beside_other_code(resolve(self._sweep.plan(settings)), self._resources.runs)
            trial = self._played(trial, [run.with_seed(seed) for seed in self._sweep.seeds], report)
        except NOT_OF_A_TRIAL:
            raise
        except Exception as error:
            return replace(trial, state=FAILED, error=f"{type(error).__name__}: {' '.join(str(error).split())}")
        self._mark(run)
        return trial

    def _played(self, trial: Trial, group: Sequence[Run], report: Progress) -> Trial:
        """The trial after the training of all its seeds, and after their episodes on `val`."""
        resources = self._resources
        with annotations.noting_failure([run.folder(resources.runs) for run in group]):
            try:
                execution.train(group, resources.runs, resources.threads, resources.device, report, self._watch())
            except loop.StoppedEarly:
                return replace(trial, state=STOPPED, points=self._points)
            for run in group:
                execution.execute(run, resources.runs, resources.threads, report)
        results = [result_files.read_result(run.folder(resources.runs).result).splits[VAL] for run in group]
        scores = np.array([result.scores for result in results], float)
        return replace(
            trial,
            state=DONE,
            returns=statistics.estimate(scores),
            successes=statistics.estimate((scores == task.SUCCESS).astype(float), statistics.SHARES),
            failed=sum(result.failed for result in results),
            points=_mean_curve(self._curves(group)),
        )

    def _watch(self) -> loop.Watch:
        """What stops a training whose learning curve is below the median of the earlier trials."""

        def watch(curves: dict[int, list[CurvePoint]]) -> None:
            self._points = _mean_curve(list(curves.values()))
            if optuna_search.should_stop(self._points, self._earlier):
                raise loop.StoppedEarly

        return watch if self._sweep.prune else loop.no_watch

    def _curves(self, group: Sequence[Run]) -> list[list[CurvePoint]]:
        """The learning curves of a method that trains; none for another."""
        job = group[0].training_job(self._resources.runs)
        files = [job.run_folder(run.seed).curve for run in group] if job else []
        return [learning_curve.read(file) for file in files]

    def _mark(self, run: Run) -> None:
        """Tags the run with the name of the sweep."""
        folder = run.folder(self._resources.runs).path.parent
        notes = annotations.read(folder)
        if self._tag not in notes.tags:
            annotations.write(folder, replace(notes, tags=(*notes.tags, self._tag)))


def _run_name(sweep: Sweep, settings: Mapping[str, Any], runs: Path) -> str:
    """The name of a trial's run; empty if the method refuses the settings."""
    try:
        run = beside_other_code(resolve(sweep.plan(settings)), runs)
    except ValueError:  # BadSettings and AgentError; the attempt says so.
        return ""
    return f"{run.label}/{run.source}"


def _mean_curve(curves: Sequence[Sequence[CurvePoint]]) -> dict[int, float]:
    """The mean return of all seeds at each epoch."""
    by_epoch: dict[int, list[float]] = {}
    for points in curves:
        for point in points:
            by_epoch.setdefault(point.epoch, []).append(point.mean)
    return {epoch: float(np.mean(values)) for epoch, values in by_epoch.items()}
