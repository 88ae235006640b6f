"""The folder of a training: everything that an interrupted training needs to continue and end with the same bytes.

After each epoch its metrics are written. After each period follow, in this order: journal, snapshots of weights,
checkpoint. The checkpoint says how many epochs are done, and lists the SHA-256 of all that belongs to it. If the other
files hold later epochs, their period was interrupted: `resume` removes these parts, and the training writes them again.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from dextron_bench.errors import BadInput, Failed
from dextron_bench.methods.agents import AgentError, as_agent_error
from dextron_bench.methods.learners import Trainer
from dextron_bench.storage import atomic, hashing, locks, records, tensors
from dextron_bench.storage.atomic import DamagedFile, IncompleteFolder, OtherForm
from dextron_bench.storage.folders import visible
from dextron_bench.storage.records import Amount, Count, Record
from dextron_bench.training import checkpoint_list, metric_rows
from dextron_bench.training.metric_rows import METRICS, MetricRow

CHECKPOINT = "checkpoint.safetensors"
JOURNALS = "journals"
LOCK = ".locked"  # Earlier versions left a file .lock.


class Busy(Failed):
    """A training that another process runs."""


class Snapshot(Record, frozen=True):
    """What a snapshot of weights says of its training, beside what a method needs to read it."""

    epoch: Count
    frames: Amount | None = None


class _Checkpoint(Record, frozen=True):
    """The metadata of a checkpoint; one of an earlier version lists no files."""

    epoch: Count
    epochs: Count
    device: str
    files: dict[str, str] | None = None


@dataclass(frozen=True, slots=True)
class TrainingProgress:
    """How many epochs of a training are done, and the device that it computes on."""

    epoch: int
    epochs: int
    device: str

    @property
    def over(self) -> bool:
        """True if all epochs are done."""
        return self.epoch >= self.epochs


class Checkpoints:
    """The files of a training that trains one agent for each of `seeds`."""

    def __init__(self, folder: Path, seeds: Sequence[int]) -> None:
        self.folder, self.seeds = folder, tuple(seeds)
        self._listed: dict[str, str] = {}  # SHA-256 of journals and snapshots of this training, by path in the folder.

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Locks the folder for this process; raises Busy if another process holds the lock."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as lock:
            try:
                lock.enter_context(locks.held(self.folder / LOCK))
            except locks.Held as error:
                raise Busy(
                    f"another process is training in {self.folder}; wait for it, or choose another --runs ({error})"
                ) from None
            for file in self.folder.rglob(f".*{atomic.PART}"):  # From a process that was killed while it wrote.
                if not file.name.startswith(f".{LOCK}"):  # Others that ask for the lock write this.
                    file.unlink()
            yield

    @property
    def is_locked(self) -> bool:
        """True if another process trains in the folder."""
        return locks.is_held(self.folder / LOCK)

    def progress(self) -> TrainingProgress | None:
        """The progress in the last checkpoint, None if there is no checkpoint; raises DamagedFile."""
        about = self._about()
        return TrainingProgress(about.epoch, about.epochs, about.device) if about else None

    def _about(self) -> _Checkpoint | None:
        """The metadata of the last checkpoint, None if there is no checkpoint; raises DamagedFile."""
        file = self.folder / CHECKPOINT
        if not file.exists():
            return None
        try:
            return records.read_about(file, _Checkpoint)
        except tensors.OtherTensors as error:
            raise OtherForm(self.folder, error) from error
        except tensors.BadTensors as error:
            raise self._damaged(error) from error

    def save(self, trainer: Trainer, progress: TrainingProgress, rows: list[MetricRow], about: dict[str, Any]) -> None:
        """Writes the files of a period.

        `rows` are the metrics of its last epoch, which `metric_rows` has written; `about` becomes metadata of the
        weights.
        """
        epoch = progress.epoch
        with as_agent_error("journal(), weights() or state() of the trainer"):
            journal, weights, state = trainer.journal(), list(trainer.weights()), trainer.state()
        if (count := len(weights)) != len(self.seeds):
            raise AgentError(f"weights() of the trainer must have one for each of {len(self.seeds)} seeds, not {count}")
        tensors.write(self._journal(epoch), journal, {"epoch": epoch})
        frames = {row.seed: row.metrics.get("frames") for row in rows}
        for seed, arrays in zip(self.seeds, weights, strict=True):
            metadata = {**about, "seed": seed, "seeds": self.seeds, "epoch": epoch, "frames": frames.get(seed)}
            tensors.write(self.snapshot(epoch, seed), arrays, metadata)
        metric_rows.sync(self.folder)
        written = [self._journal(epoch), *(self.snapshot(epoch, seed) for seed in self.seeds)]
        self._listed |= checkpoint_list.hashes(self.folder, written)
        metrics = {METRICS: hashing.digest(metric_rows.first(self.folder, self._rows(epoch)))}
        tensors.write(self.folder / CHECKPOINT, state, {**asdict(progress), "files": self._listed | metrics})

    def resume(self, trainer: Trainer, device: str) -> None:
        """Restores a trainer from the last checkpoint, and removes everything that was written after it.

        Raises DamagedFile if something is missing or changed, and BadInput if the training began on another
        device: its numbers differ in the last bits.
        """
        progress = self.progress()
        if not progress and len(self._snapshots()) > 1:  # One is of a first period that was interrupted.
            raise IncompleteFolder(self.folder, f"{CHECKPOINT} is missing")
        if progress and progress.device != device:
            raise BadInput(
                f"{self.folder} was begun on {progress.device}: continue with --device {progress.device}, or remove it"
            )
        self._listed = self._checked(progress.epoch) if progress else {}
        self._discard_after(progress.epoch if progress else 0)
        if progress:
            self._restore(trainer)
            if trainer.epoch != progress.epoch:
                raise OtherForm(self.folder, f"it restores epoch {trainer.epoch}, not {progress.epoch}")

    def finish(self) -> None:
        """Removes the journals, which only an unfinished training needs; raises DamagedFile if something is changed."""
        if progress := self.progress():
            self._checked(progress.epoch, finished=True)
        shutil.rmtree(self.folder / JOURNALS, ignore_errors=True)

    def snapshot(self, epoch: int, seed: int) -> Path:
        """The file with the weights of a seed after an epoch."""
        return self.folder / "weights" / f"epoch-{epoch:04d}" / f"seed{seed}.safetensors"

    def epochs(self) -> list[int]:
        """The epochs with snapshots, in order."""
        progress = self.progress()
        return sorted(epoch for epoch in self._snapshots() if progress and epoch <= progress.epoch)

    def metrics(self) -> list[MetricRow]:
        """One row for each epoch and seed, in order; raises DamagedFile."""
        return metric_rows.read(self.folder)

    def _checked(self, epoch: int, finished: bool = False) -> dict[str, str]:
        """The list of the last checkpoint, after a check of all that it names; raises DamagedFile.

        A training that is `finished` needs no journals and no state. The list of an earlier version is made now.
        """
        about = self._about()
        present = [self.snapshot(number, seed) for number in self.epochs() for seed in self.seeds]
        if not finished:
            present += [self._journal(number) for number in self._journaled() if number <= epoch]
        if about is None or about.files is None:
            return checkpoint_list.hashes(self.folder, [file for file in present if file.exists()])
        listed = {name: sha256 for name, sha256 in about.files.items() if name != METRICS}
        needed = {name: listed[name] for name in listed if not (finished and name.startswith(JOURNALS))}
        checkpoint_list.check(self.folder, needed, present)
        if hashing.digest(metric_rows.first(self.folder, self._rows(epoch))) != about.files.get(METRICS):
            raise self._damaged(f"{METRICS} differs from what its checkpoint lists")
        return listed

    def _restore(self, trainer: Trainer) -> None:
        """Restores a trainer from checkpoint and journals; raises DamagedFile, AgentError."""
        try:
            state = tensors.read(self.folder / CHECKPOINT)
            with as_agent_error("restore() of the trainer"):
                trainer.restore(state, (tensors.read(self._journal(epoch)) for epoch in self._journaled()))
        except (tensors.BadTensors, AgentError) as error:
            cause = error if isinstance(error, tensors.BadTensors) else error.__cause__
            if isinstance(cause, tensors.BadTensors):
                raise self._damaged(cause) from error
            if isinstance(cause, (OSError, MemoryError)):  # No fault of the files.
                raise cause from error
            raise

    def _discard_after(self, epoch: int) -> None:
        """Removes journals, snapshots and metrics of later epochs; raises DamagedFile if metrics are missing."""
        for later in [number for number in self._journaled() if number > epoch]:
            self._journal(later).unlink()
        for number, snapshots in self._snapshots().items():
            if number > epoch:
                shutil.rmtree(snapshots)
        metric_rows.cut(self.folder, self._rows(epoch))

    def _rows(self, epoch: int) -> int:
        """The number of rows of metrics up to an epoch."""
        return epoch * len(self.seeds)

    def _snapshots(self) -> dict[int, Path]:
        """The folders of snapshots, by epoch."""
        folders = {folder.name.removeprefix("epoch-"): folder for folder in visible(self.folder / "weights", "epoch-*")}
        return {int(number): folder for number, folder in folders.items() if number.isdecimal()}

    def _journaled(self) -> list[int]:
        """The epochs with a journal, in order."""
        files = visible(self.folder / JOURNALS, "[0-9]*.safetensors")
        return sorted(int(file.stem) for file in files if file.stem.isdecimal())

    def _journal(self, epoch: int) -> Path:
        return self.folder / JOURNALS / f"{epoch:06d}.safetensors"

    def _damaged(self, why: object) -> DamagedFile:
        return DamagedFile(self.folder, why)
