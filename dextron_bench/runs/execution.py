"""Executes runs: trains the learner if there is one, evaluates on splits, records episodes, writes the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods import registry, weights
from dextron_bench.methods.agents import Agent, Privileged, as_agent_error
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import plans, playing, result_files, run_files
from dextron_bench.runs.evaluation_job import EvaluationJob, Played
from dextron_bench.runs.plans import Run, no_weights
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.storage import folder_config, provenance
from dextron_bench.storage.pieces import Place, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.training import loop

WEIGHTS = "weights"  # Folder below the runs of another process, with the file of weights.


class NotTrained(LookupError):
    """A run whose weights are missing where nothing may be trained."""


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
    AgentError, MissingWeights, and the errors of `EvaluationJob.table`.
    """
    source, splits = _played(run)  # Splits or data that are missing end the command before the training.
    training = run.training_job(runs)
    if training:
        train([run], runs, threads)
    job = _prepare(run, runs, source, splits, threads)
    with playing.shown(job.folder, report) as report_and_show:
        table = job.table(report_and_show)
    result_files.write_result(job.folder, table, job.facts, training.seconds(run.seed) if training else None)
    return job.folder.path


def prepare(run: Run, runs: Path, threads: int = 0, splits: Sequence[Split] = ()) -> EvaluationJob:
    """The evaluation of a run whose training is done, on its splits if they are loaded; writes its folder's config.

    Raises NotTrained, FolderMismatch, DamagedFile, UnknownSplit, MissingData, AgentError, MissingWeights.
    """
    return _prepare(run, runs, *_played(run), threads)


def _played(run: Run) -> tuple[Source, list[Split]]:
    """The source of reaches and the splits that a run plays; raises UnknownSplit, MissingData."""
    splits = [load_split(run.source, name) for name in run.splits]
    return sources.open_source(run.source), splits


def _prepare(run: Run, runs: Path, source: Source, splits: Sequence[Split], threads: int) -> EvaluationJob:
    """The evaluation of a run on splits."""
    folder, file = run.folder(runs), weights_file(run, runs)
    if file and not file.exists():
        raise NotTrained(
            f"{run.label} is not trained for seed {run.seed}: {file} is missing, and a share or a merge trains "
            "nothing; train it first with `--split val` and without --share, and copy the folder of runs"
        )
    new_agent = agents(run, file)
    player, config = new_agent(), run.config()  # If an agent cannot be made, there is no folder yet.
    folder_config.write_or_check(folder.path, config, registry.defaults_of(run.method))
    sha256 = run_files.copy_weights(file, folder) if file else None

    def play(split: Split, rows: range) -> Played:
        for place, episode in rollout(new_agent(), source, split.rows(rows), threads=threads):
            yield rows.start + place, episode

    facts = run.about | (_training_facts(run, folder.weights, sha256) if sha256 else {})
    facts |= {"privileged": "each setting's expert"} if isinstance(player, Privileged) else {}
    return EvaluationJob(
        folder.path,
        source,
        splits,
        play,
        run.plan.record,
        run.about,
        facts,
        config | {"weights": sha256},
        provenance.code_hash(*registry.package_files(type(run.method))),
        _recipe(run, file),
        getattr(player, "rows_are_independent", False) is True,
        threads=threads,
    )


def _recipe(run: Run, file: Path | None) -> Recipe:
    """How another process makes the evaluation of a run, with a file of weights."""
    plan, files = plans.without_file(run.plan)
    files |= {f"{WEIGHTS}/{file.name}": file} if file else {}
    arguments = {"plan": replace(plan, weights=Path(file.name) if file else None), "label": run.label}
    return Recipe(_prepare_again, arguments, run.source, files)


def _prepare_again(place: Place, plan: plans.Plan, label: str) -> EvaluationJob:
    """The evaluation of a plan whose files another process has put below the folder of runs."""
    run = replace(plans.resolve(plans.with_file(replace(plan, weights=None), place.runs)), label=label)
    run = run.with_weights(plan.seed, place.runs / WEIGHTS / plan.weights) if plan.weights else run
    return prepare(run, place.runs, place.threads)


def agents(run: Run, file: Path | None) -> Callable[[], Agent]:
    """Makes agents of a run, each as if it were the first, with the weights of a file if its method learns.

    Raises BadWeights; what it returns raises AgentError.
    """
    if run.learner is not None:
        assert file is not None
        return weights.load_agents(run.learner, file)
    method = run.method
    assert not isinstance(method, Learner | PolicyTransfer)

    def agent() -> Agent:
        with as_agent_error(f"agent({run.seed}) of method {method.name!r}"):
            return method.agent(run.seed)

    return agent


def weights_file(run: Run, runs: Path) -> Path | None:
    """The file of weights that a run acts with; None for a method that does not learn."""
    if job := run.training_job(runs):
        return job.run_folder(run.seed).weights
    if run.plan.weights and run.learner is None:
        raise no_weights(run)
    return run.plan.weights


def _training_facts(run: Run, file: Path, sha256: str) -> dict[str, Any]:
    """What a result says of the training: the facts in the file of weights, and the number of demonstrations."""
    facts = weights.metadata(file, sha256)
    if run.learner is None or run.plan.weights:
        return {"training": facts}
    count = getattr(run.learner, "demonstrations", lambda episodes: None)
    return {"training": facts | {"demonstrations": count(len(load_split(run.training_source, "train")))}}
