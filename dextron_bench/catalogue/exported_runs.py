"""What an export says of each seed of a run: parameters, tags, metrics, state and times, as its files have them.

A run that is going on, was killed or failed has files like any other; it lacks only what was not written yet.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from msgspec import to_builtins

from dextron_bench.catalogue.run_catalogue import CataloguedRun
from dextron_bench.runs import annotations, playing, result_files
from dextron_bench.storage import run_times
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.storage.run_times import RunTimes
from dextron_bench.training import loop, metric_rows
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.world import task

FINISHED, RUNNING, FAILED, KILLED = "FINISHED", "RUNNING", "FAILED", "KILLED"  # States, in MLflow's words.


@dataclass(frozen=True, slots=True)
class Metric:
    """The value of a metric at a step, which is an epoch, or 0 for a score."""

    name: str
    value: float
    step: int = 0


@dataclass(frozen=True, slots=True)
class ExportedRun:
    """A seed of a run."""

    name: str
    state: str
    times: RunTimes
    params: dict[str, str] = field(default_factory=dict)
    tags: dict[str, str] = field(default_factory=dict)
    metrics: list[Metric] = field(default_factory=list)


def collect(entries: Iterable[CataloguedRun]) -> tuple[list[ExportedRun], list[str]]:
    """Each seed of each entry, and a line for each seed that is left out because its files cannot be read."""
    exported, left_out = [], []
    for entry in entries:
        for seed in entry.seeds:
            try:
                exported.append(_exported(entry, seed))
            except (DamagedFile, OSError) as error:
                left_out.append(f"{entry.name}/seed{seed} is left out: {error}")
    return exported, left_out


def _exported(entry: CataloguedRun, seed: int) -> ExportedRun:
    """A seed of an entry; raises DamagedFile, OSError."""
    run = RunFolder.of_seed(entry.folder, seed)
    about = {"method": entry.label, "reaches": entry.reaches, "seed": seed, "physics": entry.physics}
    code = {f"code.{name}": value for name, value in to_builtins(entry.code or {}).items() if value}
    params = {name: str(value) for name, value in {**about, **code, **entry.settings}.items()}
    metrics = [*_scores(run), *_curve(entry, seed), *_training(entry, seed)]
    tags = dict.fromkeys(entry.tags, "true")
    tags |= {"mlflow.note.content": entry.note} if entry.note else {}
    failure = annotations.failure(run)
    tags |= {"failure": failure} if failure else {}
    return ExportedRun(f"{entry.name}/seed{seed}", _state(run, failure), run_times.read(run), params, tags, metrics)


def _state(run: RunFolder, failure: str) -> str:
    """The state of a run; `failure` says why its last attempt failed."""
    trainings = loop.training_folders(run.path.parent).items()
    is_training = any(Checkpoints(folder, seeds).is_locked for folder, seeds in trainings if run.seed in seeds)
    if is_training or playing.state(run):
        return RUNNING
    if failure:
        return FAILED
    return FINISHED if run.result.exists() else KILLED


def _scores(run: RunFolder) -> Iterator[Metric]:
    """Mean return and success rate of a seed on each split."""
    splits = result_files.read_result(run.result).splits if run.result.exists() else {}
    for split, played in splits.items():
        scores = played.scores
        yield Metric(f"{split}.return", sum(scores) / len(scores))
        yield Metric(f"{split}.success", sum(score == task.SUCCESS for score in scores) / len(scores))


def _curve(entry: CataloguedRun, seed: int) -> Iterator[Metric]:
    for point in entry.curves.get(seed, ()):
        yield Metric("val_curve.return", point.mean, point.epoch)
        yield Metric("val_curve.success", point.success, point.epoch)


def _training(entry: CataloguedRun, seed: int) -> Iterator[Metric]:
    """The metrics of a seed's training, as far as it is; raises DamagedFile."""
    folders = [folder for folder, seeds in loop.training_folders(entry.folder).items() if seed in seeds]
    for row in (row for folder in folders for row in metric_rows.read(folder) if row.seed == seed):
        for name in sorted(row.metrics):
            yield Metric(f"train.{name}", row.metrics[name], row.epoch)
