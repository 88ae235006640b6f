"""The catalogue of a folder of runs: what each method with its settings has scored, and how far it is."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from dextron_bench.errors import NotFound
from dextron_bench.evaluation.results import Code, Result, RunConfig
from dextron_bench.methods.settings import Settings
from dextron_bench.runs import annotations, playing, result_files
from dextron_bench.splits.names import VAL
from dextron_bench.storage import records, run_times
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.run_folder import RunFolder, run_folders
from dextron_bench.storage.run_times import RunTimes
from dextron_bench.training import jobs, learning_curve
from dextron_bench.training.learning_curve import CurvePoint
from dextron_bench.world import task

DONE, UNFINISHED = "done", "unfinished"


@dataclass(frozen=True, slots=True)
class CataloguedRun:
    """All seeds of a method with its settings on one source of reaches.

    `scores` holds, by split, the scores (seeds, rows) of the seeds that have played it. `curves` holds, by seed, the
    points of its learning curve. `state` says in words how far it is, and
    `times` when each seed began and ended.
    """

    label: str
    reaches: str
    folder: Path
    seeds: tuple[int, ...]
    settings: Settings
    code: Code | None
    physics: str
    state: str
    times: Mapping[int, RunTimes]
    scores: Mapping[str, np.ndarray] = field(default_factory=dict)
    curves: Mapping[int, Sequence[CurvePoint]] = field(default_factory=dict)
    tags: tuple[str, ...] = ()
    note: str = ""

    @property
    def changed(self) -> datetime | None:
        """When a seed last ended, or began if it has not ended; None for runs of version 0.1, which do not say."""
        known = [moment for times in self.times.values() if (moment := times.ended or times.began)]
        return max(known, default=None)

    @property
    def name(self) -> str:
        """Label and source of reaches, such as "rlil-0.1/real"."""
        return f"{self.label}/{self.reaches}"

    def score(self, split: str, what: str = "return") -> float:
        """Mean return, or success rate, on a split; NaN if no seed has played it.

        On `val` it is the best point of the learning curves if the split itself was not played.
        """
        if split in self.scores:
            values = self.scores[split] if what == "return" else self.scores[split] == task.SUCCESS
            return float(values.mean())
        if split == VAL and self.curves:
            best = [max(points, key=lambda point: point.mean) for points in self.curves.values()]
            return float(np.mean([point.mean if what == "return" else point.success for point in best]))
        return float("nan")


def entries(runs: Path, unreadable: list[str] | None = None) -> list[CataloguedRun]:
    """The entries of a folder of runs, in the order of their names.

    `unreadable` receives a line for each entry whose files cannot be read; without it they raise DamagedFile.
    """
    groups: dict[Path, list[RunFolder]] = defaultdict(list)
    for run in run_folders(runs):
        if run.config.exists():
            groups[run.path.parent].append(run)
    left = {(training.label, training.reaches): training for training in jobs.unfinished(runs)}
    known = []
    for folder, members in groups.items():
        try:
            known.append(_entry(folder, sorted(members, key=lambda run: run.seed), left))
        except (DamagedFile, OSError) as error:
            if unreadable is None:
                raise
            unreadable.append(f"{'/'.join(folder.parts[-2:])} is left out: {error}")
    return known


def find(all_entries: Iterable[CataloguedRun], name: str) -> CataloguedRun:
    """The entry with a label, or with a label and a source of reaches; raises NotFound."""
    known = list(all_entries)
    matching = [entry for entry in known if name in (entry.name, entry.label)]
    if len(matching) == 1:
        return matching[0]
    if matching:
        raise NotFound(f"several runs are called {name!r}; choose {' or '.join(entry.name for entry in matching)}")
    raise NotFound(f"no run is called {name!r}; the folder has {', '.join(entry.name for entry in known) or 'none'}")


def _entry(
    folder: Path, members: Sequence[RunFolder], left: Mapping[tuple[str, str], jobs.UnfinishedTraining]
) -> CataloguedRun:
    label, reaches = folder.parts[-2:]
    config = records.read(members[0].config, RunConfig)
    results = [result_files.read_result(run.result) for run in members if run.result.exists()]
    notes = annotations.read(folder)
    return CataloguedRun(
        label,
        reaches,
        folder,
        tuple(run.seed for run in members),
        {**config.defaults, **(config.settings or {})},
        config.code,
        config.physics,
        _state(members, left.get((label, reaches))),
        {run.seed: run_times.read(run) for run in members},
        _scores(results),
        {run.seed: learning_curve.read(run.curve) for run in members if run.curve.exists()},
        notes.tags,
        notes.note,
    )


def _state(members: Sequence[RunFolder], training: jobs.UnfinishedTraining | None) -> str:
    """How far the seeds of an entry are, in words."""
    if played := next(filter(None, map(playing.state, members)), ""):
        return f"playing, {played}"
    if training is not None and training.is_running:
        return f"training, {training.left} left"
    if failures := [text for run in members if (text := annotations.failure(run))]:
        return f"failed: {failures[0]}"
    if training is not None:
        return f"stopped, {training.left} left"
    return DONE if all(run.result.exists() for run in members) else UNFINISHED


def _scores(results: Iterable[Result]) -> dict[str, np.ndarray]:
    """The scores (seeds, rows) of each split, of the seeds whose rows are as many as the first seed's."""
    by_split: dict[str, list[list[float]]] = defaultdict(list)
    for result in results:
        for split, scores in result.splits.items():
            if not by_split[split] or len(by_split[split][0]) == len(scores.scores):
                by_split[split].append(scores.scores)
    return {split: np.array(rows, float) for split, rows in by_split.items()}
