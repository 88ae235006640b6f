"""The folder of a training: everything that an interrupted training needs to continue and end with the same bytes.

After each period the files are written in this order: journal, snapshots of weights, metrics, checkpoint. The
checkpoint says how many epochs are done. If the other files hold later epochs, their period was interrupted: `resume`
removes these parts, and the training writes them again.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from dextron_bench.methods.agents import AgentError, as_agent_error
from dextron_bench.methods.learners import Trainer
from dextron_bench.storage import atomic, tensors
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.folder_config import FolderMismatch

try:
    import fcntl
except ImportError:  # On Windows, nothing stops two processes from training in one folder.
    fcntl = None

CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"
JOURNALS = "journals"


class Busy(RuntimeError):
    """A training that another process runs."""


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

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Locks the folder for this process; raises Busy if another process holds the lock."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / ".lock").open("w") as lock:
            try:
                if fcntl:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Busy(
                    f"another process is training in {self.folder}; wait for it, or choose another --runs"
                ) from None
            for file in self.folder.rglob(".*.part"):  # From a process that was killed while it wrote.
                file.unlink()
            yield

    def progress(self) -> TrainingProgress | None:
        """The progress in the last checkpoint, None if there is no checkpoint; raises DamagedFile."""
        file = self.folder / CHECKPOINT
        if not file.exists():
            return None
        try:
            return TrainingProgress(**tensors.read_about(file))
        except (tensors.BadTensors, TypeError) as error:
            raise self._damaged(CHECKPOINT) from error

    def save(
        self, trainer: Trainer, progress: TrainingProgress, rows: list[dict[str, Any]], about: dict[str, Any]
    ) -> None:
        """Writes the files of a period with the metrics `rows`; `about` becomes metadata of the weights."""
        epoch = progress.epoch
        tensors.write(self._journal(epoch), trainer.journal(), {"epoch": epoch})
        frames = {row["seed"]: row.get("frames") for row in rows}
        for seed, arrays in zip(self.seeds, trainer.weights(), strict=True):
            metadata = {**about, "seed": seed, "seeds": self.seeds, "epoch": epoch, "frames": frames.get(seed)}
            tensors.write(self.snapshot(epoch, seed), arrays, metadata)
        with (self.folder / METRICS).open("a", encoding="utf-8") as file:
            file.write("".join(json.dumps(row, sort_keys=True) + "\n" for row in rows))
            file.flush()
            os.fsync(file.fileno())
        tensors.write(self.folder / CHECKPOINT, trainer.state(), asdict(progress))

    def resume(self, trainer: Trainer, device: str) -> None:
        """Restores a trainer from the last checkpoint, and removes everything that was written after it.

        Raises DamagedFile, and FolderMismatch if the training began on another device: its numbers differ in the last
        bits.
        """
        progress = self.progress()
        if progress and progress.device != device:
            raise FolderMismatch(
                f"{self.folder} was begun on {progress.device}: continue with --device {progress.device}, or remove it"
            )
        self._discard_after(progress.epoch if progress else 0)
        if progress:
            self._restore(trainer)
            if trainer.epoch != progress.epoch:
                raise self._damaged(f"it restores epoch {trainer.epoch}, not {progress.epoch}")

    def finish(self) -> None:
        """Removes the journals, which only an unfinished training needs."""
        shutil.rmtree(self.folder / JOURNALS, ignore_errors=True)

    def snapshot(self, epoch: int, seed: int) -> Path:
        """The file with the weights of a seed after an epoch."""
        return self.folder / "weights" / f"epoch-{epoch:04d}" / f"seed{seed}.safetensors"

    def epochs(self) -> list[int]:
        """The epochs with snapshots, in order."""
        progress = self.progress()
        return sorted(epoch for epoch in self._snapshots() if progress and epoch <= progress.epoch)

    def metrics(self) -> list[dict[str, Any]]:
        """One row for each epoch and seed, in order; raises DamagedFile."""
        try:
            lines = (self.folder / METRICS).read_text(encoding="utf-8").splitlines()
            return [json.loads(line) for line in lines]
        except (OSError, ValueError) as error:
            raise self._damaged(f"{METRICS}: {error}") from error

    def _restore(self, trainer: Trainer) -> None:
        """Restores a trainer from checkpoint and journals; raises DamagedFile, AgentError."""
        try:
            state = tensors.read(self.folder / CHECKPOINT)
            with as_agent_error("restore() of the trainer"):
                trainer.restore(state, (tensors.read(self._journal(epoch)) for epoch in self._journaled()))
        except (tensors.BadTensors, AgentError) as error:
            cause = error if isinstance(error, tensors.BadTensors) else error.__cause__
            if isinstance(cause, (tensors.BadTensors, OSError)):
                raise self._damaged(cause) from error
            raise

    def _discard_after(self, epoch: int) -> None:
        """Removes journals, snapshots and metrics of later epochs; raises DamagedFile if metrics are missing."""
        for later in [number for number in self._journaled() if number > epoch]:
            self._journal(later).unlink()
        for number, snapshots in self._snapshots().items():
            if number > epoch:
                shutil.rmtree(snapshots)
        file = self.folder / METRICS
        lines = file.read_bytes().splitlines(keepends=True) if file.exists() else []
        kept = lines[: epoch * len(self.seeds)]
        if len(kept) < epoch * len(self.seeds):
            raise self._damaged(f"{METRICS} ends before epoch {epoch}")
        if lines != kept:
            atomic.write_atomically(file, lambda part: part.write_bytes(b"".join(kept)))

    def _snapshots(self) -> dict[int, Path]:
        """The folders of snapshots, by epoch."""
        folders = (self.folder / "weights").glob("epoch-*")
        return {int(folder.name.removeprefix("epoch-")): folder for folder in folders}

    def _journaled(self) -> list[int]:
        """The epochs with a journal, in order."""
        return sorted(int(file.stem) for file in (self.folder / JOURNALS).glob("[0-9]*.safetensors"))

    def _journal(self, epoch: int) -> Path:
        return self.folder / JOURNALS / f"{epoch:06d}.safetensors"

    def _damaged(self, why: object) -> DamagedFile:
        return DamagedFile(self.folder, why)
