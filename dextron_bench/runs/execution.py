"""Executes runs: trains the learner if there is one, evaluates on splits, records episodes, writes the result.

`evaluate` has more than 25 lines because of its seven parameters.
"""

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
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import recording_files, result_files, run_files
from dextron_bench.runs.plans import Run, no_weights
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.storage import folder_config
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.training import loop

Played = Iterator[tuple[int, Episode]]  # Rows and their episodes, as these end.


def train(
    group: Sequence[Run],
    runs: Path,
    threads: int = 0,
    device: str = "cpu",
    report: Progress = no_progress,
    watch: loop.Watch = loop.no_watch,
) -> None:
    """Trains the learner of runs that differ only in their seeds, all seeds together; skips seeds that are trained.

    `report` receives epochs, and `watch` the learning curves as they grow. Raises the errors of `execute`, what `watch`
    raises, and Diverged, Busy, NoDevice.
    """
    for run in group:
        folder_config.check(run.folder(runs).path, run.config())
    if job := group[0].training_job(runs, threads, device):
        job.run([run.seed for run in group], report, watch)


def execute(run: Run, runs: Path, threads: int = 0, report: Progress = no_progress) -> Path:
    """Trains and evaluates what the run's folder does not hold yet; returns the folder, with its `result.json`.

    `report` receives the episodes of each split. Raises FolderMismatch, DamagedFile, UnknownSplit, MissingData,
    AgentError, MissingWeights.
    """
    folder = run.folder(runs)
    splits = [load_split(run.source, name) for name in run.splits]
    source = sources.open_source(run.source)
    train([run], runs, threads)
    weights_file = _weights_file(run, runs)
    privileged = isinstance(agent(run, weights_file), Privileged)  # If this raises, there is no folder yet.
    folder_config.write_or_check(folder.path, run.config())
    copy = run_files.copy_weights(weights_file, folder) if weights_file else None

    def play(split: Split) -> Played:
        return rollout(agent(run, copy), source, split.cases, threads=threads, track=split.track, bottles=split.bottles)

    episodes = evaluate(folder, source, splits, play, run.plan.record, run.about, report)
    about = run.about | _training_facts(run, copy) | ({"privileged": "each setting's expert"} if privileged else {})
    job = run.training_job(runs)
    result_files.write_result(folder, episodes, about, job.seconds(run.seed) if job else None)
    return folder.path


def agent(run: Run, file: Path | None) -> Agent:
    """The agent of a run, with the weights of a file if its method learns; raises AgentError, BadWeights."""
    if run.learner is not None:
        assert file is not None
        return weights.load_agent(run.learner, file)
    assert not isinstance(run.method, Learner | PolicyTransfer)
    with as_agent_error(f"agent({run.seed}) of method {run.method.name!r}"):
        return run.method.agent(run.seed)


def evaluate(
    folder: RunFolder,
    source: Source,
    splits: Sequence[Split],
    play: Callable[[Split], Played],
    record: int,
    about: dict[str, Any],
    report: Progress = no_progress,
) -> pd.DataFrame:
    """The table of episodes of a run; plays the splits that the folder lacks and stores the table after each.

    `play` plays a split and yields (row, episode) as episodes end. The first `record` rows are recorded, with `about`
    among their properties.
    """
    table = run_files.stored_episodes(folder, splits)
    for split in splits:
        stored = table[table["split"] == split.name] if len(table) else table
        if len(stored) == len(split.cases) and not recording_files.any_missing(folder, stored, record):
            continue
        rows: dict[int, dict[str, Any]] = {}
        for row, episode in play(split):
            rows[row] = episode_table.row(split, row, episode)
            if row < record and len(episode.actions):
                recording_files.record(folder, source, split, row, episode, about)
            report(len(rows), len(split.cases))
        table = _with_split(table, split.name, [rows[row] for row in sorted(rows)])
        run_files.store_episodes(folder, table)
    return table


def _with_split(table: pd.DataFrame, split: str, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """The table with other rows of a split, at its end."""
    others = [table[table["split"] != split]] if len(table) else []
    return pd.concat([*others, pd.DataFrame(rows)], ignore_index=True)


def _weights_file(run: Run, runs: Path) -> Path | None:
    """The file of weights that a run acts with; None for a method that does not learn."""
    if job := run.training_job(runs):
        return job.run_folder(run.seed).weights
    if run.plan.weights and run.learner is None:
        raise no_weights(run)
    return run.plan.weights


def _training_facts(run: Run, file: Path | None) -> dict[str, Any]:
    """What a result says of the training: the facts in the file of weights, and the number of demonstrations."""
    if file is None:
        return {}
    facts = weights.metadata(file)
    if run.learner is None or run.plan.weights:
        return {"training": facts}
    count = getattr(run.learner, "demonstrations", lambda episodes: None)
    return {"training": facts | {"demonstrations": count(len(load_split(run.training_source, "train").cases))}}
