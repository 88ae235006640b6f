"""Runs: one method, one seed, one source of reaches, trained where it has to be, and evaluated on splits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import Agent, Privileged, blaming, rollout
from dextron_bench.methods import registry as methods
from dextron_bench.methods import weights
from dextron_bench.methods.learners import Heir, Learner
from dextron_bench.methods.registry import Entrant
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import run_files as records
from dextron_bench.splits import loading as splits
from dextron_bench.training import jobs as lessons
from dextron_bench.training import loop as training

Report = Callable[[int, int], None]  # Told (done, all).
Played = Iterator[tuple[int, Episode]]  # Rows and their episodes, as these end.


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
        return methods.create(self.method, self.settings, self.reaches)

    def folder(self, runs: Path) -> Path:
        """Where the run lives."""
        return runs / self.label / self.home / f"seed{self.seed}"

    def course(self, runs: Path, threads: int = 0, device: str = "cpu") -> lessons.Course | None:
        """The training that its method or its teacher needs; None where nothing is trained."""
        method = self.make()
        learner = method.teacher if isinstance(method, Heir) else method
        if not isinstance(learner, Learner) or self.weights:
            return None
        return lessons.Course(learner, methods.home(learner, self.reaches), runs, threads, device)

    @property
    def home(self) -> str:
        """The source of reaches that the run is on."""
        return methods.home(self.make(), self.reaches)

    @property
    def label(self) -> str:
        """What the run's row is called."""
        return methods.label(self.make())

    def config(self) -> dict[str, Any]:
        """What the run depends on."""
        return records.config(self.make(), self.home, self.seed)


def quiet(done: int, total: int) -> None:
    """Reports nothing."""


def learn(
    plans: Sequence[Plan], runs: Path, threads: int = 0, device: str = "cpu", report: training.Report = training.quiet
) -> None:
    """Trains what the plans, equal but for their seeds, need and have not: all seeds together.

    `report` is told (epochs done, epochs in all, how it goes). Raises what `execute` does, Diverged, Busy, NoDevice.
    """
    for plan in plans:
        records.check(plan.folder(runs), plan.config())
    if course := plans[0].course(runs, threads, device):
        course.teach([plan.seed for plan in plans], report)


def execute(plan: Plan, runs: Path, threads: int = 0, report: Report = quiet) -> Path:
    """Evaluates what the folder does not hold yet; returns the folder, with its `result.json`.

    `report` is told (episodes done, episodes in all) of each split. Raises FolderMismatch, DamagedFile,
    UnknownMethod, UnknownSplit, MissingData, AgentError.
    """
    method = plan.make()
    folder = plan.folder(runs)
    wanted = [splits.load(plan.home, name) for name in plan.splits]
    source = sources.open_source(plan.home)
    learn([plan], runs, threads)
    given = _given(method, plan, runs)
    access: dict[str, Any] = {}
    if isinstance(agent(method, plan.seed, given), Privileged):  # Raises before there is a folder.
        access = {"privileged": "each setting's expert"}
    records.claim(folder, plan.config())
    trained = weights.adopt(given, folder) if given else None
    about = {"method": plan.label, "reaches": plan.home, "seed": plan.seed}

    def play(split: splits.Split) -> Played:
        return rollout(agent(method, plan.seed, trained), source, split.cases, threads=threads)

    episodes = evaluate(folder, source, wanted, play, plan.record, about, report)
    told = {"training": weights.about(trained) | _cost(plan, runs)} if trained else {}
    seconds = course.seconds(plan.seed) if (course := plan.course(runs)) else None
    records.conclude(folder, episodes, about | told | access, seconds)
    return folder


def _cost(plan: Plan, runs: Path) -> dict[str, Any]:
    """What a run's training took: demonstrations, where its method tells how many."""
    course = plan.course(runs)
    if not course:
        return {}
    count = getattr(course.learner, "demonstrations", lambda episodes: None)
    return {"demonstrations": count(len(splits.load(course.reaches, "train").cases))}


def evaluate(
    folder: Path,
    source: Source,
    wanted: Sequence[splits.Split],
    play: Callable[[splits.Split], Played],
    record: int,
    about: dict[str, Any],
    report: Report = quiet,
) -> pd.DataFrame:
    """The table of episodes of a run's folder, those that it lacks played and added split by split.

    `play` gives (row, episode) of a split's rows as they end; the first `record` are recorded, told of by `about`.
    """
    episodes = records.stored(folder, wanted)
    for split in wanted:
        done = episodes[episodes["split"] == split.name] if len(episodes) else episodes
        if len(done) == len(split.cases) and not records.unrecorded(folder, done, record):
            continue
        rows: dict[int, dict[str, Any]] = {}
        for index, episode in play(split):
            rows[index] = records.row(split, index, episode)
            if index < record and len(episode.actions):
                records.record(folder, source, split, index, episode, about)
            report(len(rows), len(split.cases))
        kept = [episodes[episodes["split"] != split.name]] if len(episodes) else []
        episodes = pd.concat([*kept, pd.DataFrame([rows[index] for index in sorted(rows)])], ignore_index=True)
        records.store(folder, episodes)
    return episodes


def _given(method: Entrant, plan: Plan, runs: Path) -> Path | None:
    """The file of weights that a run acts with; None for a method that has none."""
    if course := plan.course(runs):
        return lessons.place(runs, course.learner, course.reaches, plan.seed) / weights.FILE
    if plan.weights and not isinstance(method, Heir | Learner):
        raise weights.MissingWeights(f"method {method.name!r} has no weights: `dextron-bench run` evaluates it")
    return plan.weights


def agent(method: Entrant, seed: int, trained: Path | None) -> Agent:
    """A method's agent for a seed, with the weights of a file where it learns; raises AgentError, BadWeights."""
    if isinstance(method, Heir | Learner):
        assert trained is not None
        return weights.agent(method.teacher if isinstance(method, Heir) else method, trained)
    with blaming(f"agent({seed}) of method {method.name!r}"):
        return method.agent(seed)


def shipped(plan: Plan, seeds: Sequence[int]) -> list[Plan]:
    """The plan with the weights that ship, for these seeds or, where there are none, for all; raises MissingWeights."""
    method = plan.make()
    learner = method.teacher if isinstance(method, Heir) else method
    if not isinstance(learner, Learner):
        raise weights.MissingWeights(f"method {method.name!r} has no weights: `dextron-bench run` evaluates it")
    found = weights.shipped(learner, methods.home(learner, plan.reaches))
    if lost := [seed for seed in seeds or (0,) if seed not in found and (seeds or not found)]:
        others = weights.labels(learner, methods.home(learner, plan.reaches))
        raise weights.MissingWeights(
            f"no weights of {plan.label!r} on {plan.reaches} reaches ship for seed {lost[0]}; train them with "
            f"`dextron-bench run {methods.words(plan.method, plan.settings)} --reaches {plan.reaches} --seed {lost[0]}`"
            + (f", or take what ships: {', '.join(others)}" if others else "")
        )
    return [replace(plan, seed=seed, weights=found[seed]) for seed in seeds or found]
