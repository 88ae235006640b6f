"""Which seeds of a method are still to be trained, and what their training leaves in the folders of runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from dextron_bench.methods import registry, weights
from dextron_bench.methods.learners import Learner, Track
from dextron_bench.reaches import sources
from dextron_bench.runs import run_files
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import atomic, tensors
from dextron_bench.training import loop, timing
from dextron_bench.training.checkpoints import Checkpoints
from dextron_bench.training.learning_curve import Curve

CURVE = "curve.json"  # In a run's folder.


class NoDevice(ValueError):
    """A device that this machine has not."""


def place(runs: Path, learner: Learner, reaches: str, seed: int) -> Path:
    """The folder of a learner's run."""
    return runs / learner.label / reaches / f"seed{seed}"


@dataclass(frozen=True)
class TrainingJob:
    """The training of a learner on a source of reaches."""

    learner: Learner
    reaches: str
    runs: Path
    threads: int = 0
    device: str = "cpu"

    def groups(self, seeds: Sequence[int]) -> list[tuple[int, ...]]:
        """The seeds that need training, as they train together; those whose training is over first."""
        missing = [seed for seed in dict.fromkeys(seeds) if not (self._run(seed) / weights.FILE).exists()]
        over = [group for group in self._over() if set(group) & set(missing)]
        rest = tuple(seed for seed in missing if not any(seed in group for group in over))
        return [*over, rest] if rest else over

    def run(self, seeds: Sequence[int], report: loop.Report | None = None) -> None:
        """Trains seeds that are not trained yet, and puts best weights and curve into the folders of their runs.

        Raises Diverged, AgentError, Busy, NoDevice, FolderMismatch, DamagedFile, UnknownSplit, MissingData.
        """
        for seed in seeds:
            run_files.check(self._run(seed), registry.config(self.learner, self.reaches, seed))
        for group in self.groups(seeds):
            track, val = self.track(), load_split(self.reaches, "val")
            folder = loop.folder_of(self._base, group)
            for seed in group:
                run_files.claim(self._run(seed), registry.config(self.learner, self.reaches, seed))
            done = loop.train(self.learner, track, group, folder, val, report or loop.quiet)
            curve = Curve(self.learner, done, track.source, val, self.threads)
            for seed in group:
                self._publish_best(done, curve, seed)

    def track(self) -> Track:
        """What there is to train with; raises NoDevice, UnknownSplit, MissingData."""
        cases = load_split(self.reaches, "train").cases
        source = sources.open_source(self.reaches)
        return Track(source, cases, self.runs / "cache", self.threads, _device(self.device))

    def folder(self, group: Sequence[int]) -> Path:
        """Where a group trains."""
        return loop.folder_of(self._base, group)

    def seconds(self, seed: int) -> float | None:
        """How long the training of a seed's group took; None where its folder is not there."""
        found = [each for each in self._over() if seed in each]
        return timing.seconds(self.folder(found[0])) if found else None

    @property
    def _base(self) -> Path:
        return self.runs / self.learner.label / self.reaches

    def _run(self, seed: int) -> Path:
        return place(self.runs, self.learner, self.reaches, seed)

    def _over(self) -> list[tuple[int, ...]]:
        """The groups whose epochs are all done."""
        found = []
        for folder, group in loop.groups(self._base).items():
            progress = Checkpoints(folder, group).progress()
            if progress and progress.over:
                found.append(group)
        return found

    def _publish_best(self, done: Checkpoints, curve: Curve, seed: int) -> None:
        """Puts a seed's learning curve and best weights into the folder of its run, the weights last."""
        best, last = curve.best(seed), done.epochs()[-1]
        snapshot = done.snapshot(best, seed)
        frames = tensors.read_about(done.snapshot(last, seed)).get("frames")
        about = tensors.read_about(snapshot) | {"best_epoch": best, "epochs": last, "frames": frames and int(frames)}
        del about["epoch"]
        atomic.write_json(self._run(seed) / CURVE, {"split": "val", "points": curve.points(seed)})
        tensors.write(self._run(seed) / weights.FILE, tensors.read(snapshot), about | {"reaches": self.reaches})


@dataclass(frozen=True, slots=True)
class UnderWay:
    """A training that is not over: what is left of it, in words."""

    label: str
    reaches: str
    seeds: tuple[int, ...]
    left: str


def under_way(runs: Path) -> list[UnderWay]:
    """The trainings below a folder of runs that are not over; raises DamagedFile."""
    found = []
    for folder, group in loop.groups(runs, "*/*/").items():
        progress = Checkpoints(folder, group).progress()
        if not progress or not progress.over:
            left = f"{progress.epochs - progress.epoch} of {progress.epochs} epochs" if progress else "all epochs"
            found.append(UnderWay(folder.parts[-3], folder.parts[-2], group, left))
    return found


def _device(name: str) -> str:
    """The device of that name; `auto` is a GPU where there is one. Raises NoDevice."""
    if name == "cpu":
        return name
    import torch

    if torch.cuda.is_available():
        return "cuda"
    if name == "auto":
        return "cpu"
    raise NoDevice("no CUDA device is at hand; `dextron-bench doctor` shows what is. Leave out --device, or say auto")
