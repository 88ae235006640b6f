"""Runs: one method, one seed, one source of reaches, trained where it has to be, and evaluated on splits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation import episode_table
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods import weights
from dextron_bench.methods.agents import Agent, Privileged, as_agent_error
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.methods.registry import Entrant
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import recording_files, result_files, run_files
from dextron_bench.runs.plans import Plan
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.training import jobs, loop

Report = Callable[[int, int], None]  # Told (done, all).
Played = Iterator[tuple[int, Episode]]  # Rows and their episodes, as these end.


def quiet(done: int, total: int) -> None:
    """Reports nothing."""


def learn(
    plans: Sequence[Plan], runs: Path, threads: int = 0, device: str = "cpu", report: loop.Report = loop.quiet
) -> None:
    """Trains what the plans, equal but for their seeds, need and have not: all seeds together.

    `report` is told (epochs done, epochs in all, how it goes). Raises what `execute` does, Diverged, Busy, NoDevice.
    """
    for plan in plans:
        run_files.check(plan.folder(runs), plan.config())
    if course := plans[0].course(runs, threads, device):
        course.run([plan.seed for plan in plans], report)


def execute(plan: Plan, runs: Path, threads: int = 0, report: Report = quiet) -> Path:
    """Evaluates what the folder does not hold yet; returns the folder, with its `result.json`.

    `report` is told (episodes done, episodes in all) of each split. Raises FolderMismatch, DamagedFile,
    UnknownMethod, UnknownSplit, MissingData, AgentError.
    """
    method = plan.make()
    folder = plan.folder(runs)
    wanted = [load_split(plan.source, name) for name in plan.splits]
    source = sources.open_source(plan.source)
    learn([plan], runs, threads)
    given = _given(method, plan, runs)
    access: dict[str, Any] = {}
    if isinstance(agent(method, plan.seed, given), Privileged):  # Raises before there is a folder.
        access = {"privileged": "each setting's expert"}
    run_files.claim(folder, plan.config())
    trained = run_files.adopt(given, folder) if given else None
    about = {"method": plan.label, "reaches": plan.source, "seed": plan.seed}

    def play(split: Split) -> Played:
        return rollout(agent(method, plan.seed, trained), source, split.cases, threads=threads)

    episodes = evaluate(folder, source, wanted, play, plan.record, about, report)
    told = {"training": weights.about(trained) | _cost(plan, runs)} if trained else {}
    seconds = course.seconds(plan.seed) if (course := plan.course(runs)) else None
    result_files.conclude(folder, episodes, about | told | access, seconds)
    return folder


def _cost(plan: Plan, runs: Path) -> dict[str, Any]:
    """What a run's training took: demonstrations, where its method tells how many."""
    course = plan.course(runs)
    if not course:
        return {}
    count = getattr(course.learner, "demonstrations", lambda episodes: None)
    return {"demonstrations": count(len(load_split(course.reaches, "train").cases))}


def evaluate(
    folder: Path,
    source: Source,
    wanted: Sequence[Split],
    play: Callable[[Split], Played],
    record: int,
    about: dict[str, Any],
    report: Report = quiet,
) -> pd.DataFrame:
    """The table of episodes of a run's folder, those that it lacks played and added split by split.

    `play` gives (row, episode) of a split's rows as they end; the first `record` are recorded, told of by `about`.
    """
    episodes = run_files.stored(folder, wanted)
    for split in wanted:
        done = episodes[episodes["split"] == split.name] if len(episodes) else episodes
        if len(done) == len(split.cases) and not recording_files.unrecorded(folder, done, record):
            continue
        rows: dict[int, dict[str, Any]] = {}
        for index, episode in play(split):
            rows[index] = episode_table.row(split, index, episode)
            if index < record and len(episode.actions):
                recording_files.record(folder, source, split, index, episode, about)
            report(len(rows), len(split.cases))
        kept = [episodes[episodes["split"] != split.name]] if len(episodes) else []
        episodes = pd.concat([*kept, pd.DataFrame([rows[index] for index in sorted(rows)])], ignore_index=True)
        run_files.store(folder, episodes)
    return episodes


def _given(method: Entrant, plan: Plan, runs: Path) -> Path | None:
    """The file of weights that a run acts with; None for a method that has none."""
    if course := plan.course(runs):
        return jobs.place(runs, course.learner, course.reaches, plan.seed) / weights.FILE
    if plan.weights and not isinstance(method, PolicyTransfer | Learner):
        raise weights.MissingWeights(f"method {method.name!r} has no weights: `dextron-bench run` evaluates it")
    return plan.weights


def agent(method: Entrant, seed: int, trained: Path | None) -> Agent:
    """A method's agent for a seed, with the weights of a file where it learns; raises AgentError, BadWeights."""
    if isinstance(method, PolicyTransfer | Learner):
        assert trained is not None
        return weights.agent(method.source_policy if isinstance(method, PolicyTransfer) else method, trained)
    with as_agent_error(f"agent({seed}) of method {method.name!r}"):
        return method.agent(seed)
