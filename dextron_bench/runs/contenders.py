"""Finds what a comparison in order compares: the stored scores of a name, or the agents that it names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.methods import registry, weights
from dextron_bench.runs import plans, result_files
from dextron_bench.runs.in_order import FOLDER, PlayedScores, ScoresInOrder, StoredScores
from dextron_bench.runs.plans import Plan, Run
from dextron_bench.splits.loading import Split
from dextron_bench.storage import provenance, schemas
from dextron_bench.world import model


class OtherSource(ValueError):
    """A method that is always evaluated on another source of reaches."""


def open_scores(name: str, split: Split, runs: Path, seeds: Sequence[int] = (), threads: int = 0) -> ScoresInOrder:
    """The scores of a method: of finished runs on this version of the split and this physics, else played now.

    `name` is what `result_files.find` takes, a file of weights, the label of weights that ship, or a method's name,
    module:Class or file.py:Class. `seeds` are the seeds of agents that play; by default all whose weights ship, else 0.

    Raises OtherSource, the errors of `plans.resolve`, MissingWeights, FolderMismatch.
    """
    stored = _stored(name, split, runs)
    if stored is None and ":" in name:
        stored = _stored_of_agent(name, split, runs)
    if stored is not None:
        return StoredScores(name, stored, split)
    resolved = [plans.beside_other_code(run, runs / FOLDER) for run in _agents(name, split, seeds)]
    return PlayedScores(resolved, split, runs, threads)


def _stored(name: str, split: Split, runs: Path) -> np.ndarray | None:
    """The scores (seeds, rows) in finished runs; None if there are none of this version and this physics."""
    if name.endswith(weights.SUFFIX):
        return None
    try:
        results = result_files.find(name, runs, split.name)
    except result_files.UnknownResult:
        return None
    return _scores(results, split)


def _stored_of_agent(name: str, split: Split, runs: Path) -> np.ndarray | None:
    """The scores in finished runs of the agent module:Class or file.py:Class, if they were made by its present code."""
    run = plans.resolve(Plan(name, split.reaches, (split.name,)))
    if run.learner is not None or run.source != split.reaches:
        return None
    label, code = plans.beside_other_code(run, runs).label, run.config()["code"]
    folders = [
        folder
        for folder in result_files.finished(runs, label)
        if schemas.read(folder.config, schemas.CONFIG).get("code") == code
    ]
    return _scores([result_files.read_result(folder.result) for folder in folders], split)


def _scores(results: Iterable[dict[str, Any]], split: Split) -> np.ndarray | None:
    """The scores (seeds, rows) in results on this version of the split and this physics; None if there are none."""
    scores = [
        result["splits"][split.name]["scores"]
        for result in results
        if result["reaches"] == split.reaches
        and provenance.physics_of(result) == model.mjcf_hash()
        and result["splits"].get(split.name, {}).get("digest") == split.digest
    ]
    return np.array(scores, float) if scores else None


def _agents(name: str, split: Split, seeds: Sequence[int]) -> list[Run]:
    """The runs of a method's agents, one for each seed."""
    if name.endswith(weights.SUFFIX):
        return [_run_of_weights(Path(name), split)]
    is_method = ":" in name or name in registry.installed_methods()
    files = [] if is_method else _shipped_files(name, split.reaches, seeds)
    if files:
        return [_run_of_weights(file, split) for file in files]
    run = _checked(plans.resolve(Plan(name, split.reaches, (split.name,))), split)
    if run.learner is not None:
        return plans.with_shipped_weights(run, seeds)
    return [run.with_seed(seed) for seed in seeds or (0,)]


def _shipped_files(label: str, reaches: str, seeds: Sequence[int]) -> list[Path]:
    """The files of the shipped weights with a label, of these seeds if some are given."""
    files = [file for file in weights.all_shipped(reaches) if file.parts[-3] == label]
    return [file for file in files if not seeds or weights.seed_of(file) in seeds]


def _run_of_weights(file: Path, split: Split) -> Run:
    """The run that acts with the weights of a file, which names its own method."""
    method, settings = weights.maker_of(file)
    run = _checked(plans.resolve(Plan(method, split.reaches, (split.name,), settings=settings)), split)
    return run.with_weights(weights.seed_of(file), file)


def _checked(run: Run, split: Split) -> Run:
    """The run itself; raises OtherSource if it is not evaluated on the split's reaches."""
    if run.source != split.reaches:
        raise OtherSource(f"{run.label} is always evaluated on {run.source} reaches, not on {split.reaches}")
    return run
