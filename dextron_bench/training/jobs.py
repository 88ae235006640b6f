"""Training jobs: which seeds still need training, and what a training leaves in the folders of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dextron_bench.errors import BadInput
from dextron_bench.methods import registry
from dextron_bench.methods.learners import Learner, TrainingSetup
from dextron_bench.reaches import sources
from dextron_bench.splits import strata
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.storage import atomic, folder_config, records, tensors
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder, runs_without, source_folder
from dextron_bench.training import loop, timing
from dextron_bench.training.checkpoints import Checkpoints, Snapshot
from dextron_bench.training.learning_curve import Curve, CurveFile


class NoDevice(BadInput):
    """A device that this machine does not have."""


@dataclass(frozen=True)
class TrainingJob:
    """The training of a learner on a source of reaches, for any seeds.

    With `without`, a subject, the rows of `train` and `val` with that subject's reaches are left out, and the folders
    are below `<runs>/without/<subject>`.
    """

    learner: Learner
    reaches: str
    runs: Path
    threads: int = 0
    device: str = "cpu"
    without: str = ""

    def groups(self, seeds: Sequence[int]) -> list[tuple[int, ...]]:
        """The seeds that need training, in the groups that train together; finished groups come first."""
        missing = [seed for seed in dict.fromkeys(seeds) if not self.run_folder(seed).weights.exists()]
        finished = [group for group in self._finished() if set(group) & set(missing)]
        rest = tuple(seed for seed in missing if not any(seed in group for group in finished))
        return [*finished, rest] if rest else finished

    def run(self, seeds: Sequence[int], report: Progress = no_progress, watch: loop.Watch = loop.no_watch) -> None:
        """Trains the seeds that need it, and writes best weights and curve into the folders of their runs.

        `watch` receives the learning curves as they grow. Raises what it raises, Failed, AgentError, Busy, NoDevice,
        BadInput, DamagedFile, UnknownSplit, MissingData.
        """
        for seed in seeds:
            folder_config.check(self.run_folder(seed).path, registry.run_config(self.learner, self.reaches, seed))
        for group in self.groups(seeds):
            setup, val = replace(self.setup(), report=report), self._split("val")
            for seed in group:
                config = registry.run_config(self.learner, self.reaches, seed)
                folder_config.write_or_check(self.run_folder(seed).path, config)
            checkpoints = loop.train(self.learner, setup, group, self.training_folder(group), val, report, watch)
            curve = Curve(self.learner, checkpoints, setup.source, val, self.threads)
            for seed in group:
                self._publish_best(checkpoints, curve, seed)

    def setup(self) -> TrainingSetup:
        """What the learner trains with; raises NoDevice, UnknownSplit, MissingData."""
        cases = self._split("train").cases
        source = sources.open_source(self.reaches)
        return TrainingSetup(source, cases, self.runs / "cache", self.threads, _device(self.device))

    def run_folder(self, seed: int) -> RunFolder:
        """The folder of a seed's run."""
        return RunFolder.of(self._runs, self.learner.label, self.reaches, seed)

    def training_folder(self, group: Sequence[int]) -> Path:
        """The folder in which a group of seeds trains."""
        return loop.folder_of(self._source_folder, group)

    def training_folders(self, seeds: Sequence[int]) -> list[Path]:
        """The folders in which seeds train, or have been trained."""
        trained = [group for group in self._finished() if set(group) & set(seeds)]
        return [self.training_folder(group) for group in dict.fromkeys([*trained, *self.groups(seeds)])]

    def seconds(self, seed: int) -> float | None:
        """Duration of the training of a seed's group [s]; None if there is no such training."""
        groups = [group for group in self._finished() if seed in group]
        return timing.seconds(self.training_folder(groups[0])) if groups else None

    @property
    def _source_folder(self) -> Path:
        return source_folder(self._runs, self.learner.label, self.reaches)

    @property
    def _runs(self) -> Path:
        return runs_without(self.runs, self.without) if self.without else self.runs

    def _split(self, name: str) -> Split:
        """A split, without the rows of the subject that is left out."""
        split = load_split(self.reaches, name)
        return strata.by_subject(split, self.without)[1] if self.without else split

    def _finished(self) -> list[tuple[int, ...]]:
        """The groups whose epochs are all done."""
        folders = loop.training_folders(self._source_folder)
        progress = {group: Checkpoints(folder, group).progress() for folder, group in folders.items()}
        return [group for group, state in progress.items() if state and state.over]

    def _publish_best(self, checkpoints: Checkpoints, curve: Curve, seed: int) -> None:
        """Writes learning curve and best weights of a seed into the folder of its run, the weights last."""
        best, last = curve.best(seed), checkpoints.epochs()[-1]
        snapshot, run = checkpoints.snapshot(best, seed), self.run_folder(seed)
        frames = records.read_about(checkpoints.snapshot(last, seed), Snapshot).frames
        records.read_about(snapshot, Snapshot)
        about = tensors.read_about(snapshot)
        about |= {"best_epoch": best, "epochs": last, "frames": None if frames is None else int(frames)}
        about |= {"without": self.without} if self.without else {}
        del about["epoch"]
        atomic.write_json(run.curve, CurveFile(curve.points(seed), "val"))
        tensors.write(run.weights, tensors.read(snapshot), about | {"reaches": self.reaches})


@dataclass(frozen=True, slots=True)
class UnfinishedTraining:
    """A training with epochs left; `left` says how many, in words. It is running if a process holds its lock."""

    label: str
    reaches: str
    seeds: tuple[int, ...]
    left: str
    is_running: bool


def unfinished(runs: Path) -> list[UnfinishedTraining]:
    """The trainings below a folder of runs that have epochs left; raises DamagedFile."""
    trainings = []
    for folder, group in loop.training_folders(runs, "*/*/").items():
        progress = Checkpoints(folder, group).progress()
        if not progress or not progress.over:
            left = f"{progress.epochs - progress.epoch} of {progress.epochs} epochs" if progress else "all epochs"
            label, reaches = folder.parts[-3:-1]
            trainings.append(UnfinishedTraining(label, reaches, group, left, Checkpoints(folder, group).is_locked))
    return trainings


def _device(name: str) -> str:
    """The device of that name; `auto` is a GPU if there is one. Raises NoDevice."""
    if name == "cpu":
        return name
    import torch

    if torch.cuda.is_available():
        return "cuda"
    if name == "auto":
        return "cpu"
    raise NoDevice("this machine has no CUDA device (see `dextron-bench doctor`); leave out --device, or use auto")
