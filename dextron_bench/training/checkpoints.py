"""The folder of a training: what it takes to go on from its last checkpoint as if nothing had happened.

A period's files are written in this order: journal, snapshots of weights, metrics, checkpoint. The checkpoint says
how many epochs are done; what the others hold beyond that is of a period that was cut off, and is written again.
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
except ImportError:  # Windows; there nothing stops two processes from training in one folder.
    fcntl = None

CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"
JOURNALS = "journals"


class Busy(RuntimeError):
    """A training that another process is at."""


@dataclass(frozen=True, slots=True)
class TrainingProgress:
    """How far a training is, and the device that it computes on."""

    epoch: int
    epochs: int
    device: str

    @property
    def over(self) -> bool:
        """Whether all epochs are done."""
        return self.epoch >= self.epochs


class Checkpoints:
    """The files from which the training of one agent for each of `seeds` goes on."""

    def __init__(self, folder: Path, seeds: Sequence[int]) -> None:
        self.folder, self.seeds = folder, tuple(seeds)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keeps other processes out; raises Busy where one is in."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / ".lock").open("w") as lock:
            try:
                if fcntl:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Busy(
                    f"another process is training in {self.folder}; wait for it, or choose another --runs"
                ) from None
            for file in self.folder.rglob(".*.part"):  # Left by a process that was killed while it wrote.
                file.unlink()
            yield

    def progress(self) -> TrainingProgress | None:
        """How far the last checkpoint is; None where there is none. Raises DamagedFile."""
        file = self.folder / CHECKPOINT
        if not file.exists():
            return None
        try:
            return TrainingProgress(**tensors.read_about(file))
        except (tensors.BadTensors, TypeError) as error:
            raise self._damaged(CHECKPOINT) from error

    def save(self, trainer: Trainer, done: TrainingProgress, rows: list[dict[str, Any]], about: dict[str, Any]) -> None:
        """Writes a checkpoint after a period whose metrics are `rows`; `about` goes with the weights."""
        epoch = done.epoch
        tensors.write(self._journal(epoch), trainer.journal(), {"epoch": epoch})
        frames = {row["seed"]: row.get("frames") for row in rows}
        for seed, arrays in zip(self.seeds, trainer.weights(), strict=True):
            told = {**about, "seed": seed, "seeds": self.seeds, "epoch": epoch, "frames": frames.get(seed)}
            tensors.write(self.snapshot(epoch, seed), arrays, told)
        with (self.folder / METRICS).open("a", encoding="utf-8") as file:
            file.write("".join(json.dumps(row, sort_keys=True) + "\n" for row in rows))
            file.flush()
            os.fsync(file.fileno())
        tensors.write(self.folder / CHECKPOINT, trainer.state(), asdict(done))

    def resume(self, trainer: Trainer, device: str) -> None:
        """Puts a trainer where the last checkpoint is and drops what was written after it.

        Raises DamagedFile, and FolderMismatch where another device computed so far, since its last bits differ.
        """
        done = self.progress()
        if done and done.device != device:
            raise FolderMismatch(
                f"{self.folder} was begun on {done.device}: go on with --device {done.device}, or remove it"
            )
        self._discard(done.epoch if done else 0)
        if done:
            try:
                state = tensors.read(self.folder / CHECKPOINT)
                with as_agent_error("restore() of the trainer"):
                    trainer.restore(state, (tensors.read(self._journal(epoch)) for epoch in self._journaled()))
            except (tensors.BadTensors, AgentError) as error:
                cause = error if isinstance(error, tensors.BadTensors) else error.__cause__
                if isinstance(cause, (tensors.BadTensors, OSError)):
                    raise self._damaged(cause) from error
                raise
            if trainer.epoch != done.epoch:
                raise self._damaged(f"it restores epoch {trainer.epoch}, not {done.epoch}")

    def finish(self) -> None:
        """Drops journals, which only a training that goes on needs."""
        shutil.rmtree(self.folder / JOURNALS, ignore_errors=True)

    def snapshot(self, epoch: int, seed: int) -> Path:
        """Where the weights of a seed after an epoch are."""
        return self.folder / "weights" / f"epoch-{epoch:04d}" / f"seed{seed}.safetensors"

    def epochs(self) -> list[int]:
        """The epochs of which there are snapshots, in order."""
        done = self.progress()
        found = (int(place.name.removeprefix("epoch-")) for place in (self.folder / "weights").glob("epoch-*"))
        return sorted(epoch for epoch in found if done and epoch <= done.epoch)

    def metrics(self) -> list[dict[str, Any]]:
        """One row for each epoch and seed, in order; raises DamagedFile."""
        try:
            lines = (self.folder / METRICS).read_text(encoding="utf-8").splitlines()
            return [json.loads(line) for line in lines]
        except (OSError, ValueError) as error:
            raise self._damaged(f"{METRICS}: {error}") from error

    def _discard(self, epoch: int) -> None:
        """Removes what was written after an epoch."""
        for later in [each for each in self._journaled() if each > epoch]:
            self._journal(later).unlink()
        for place in (self.folder / "weights").glob("epoch-*"):
            if int(place.name.removeprefix("epoch-")) > epoch:
                shutil.rmtree(place)
        file = self.folder / METRICS
        lines = file.read_bytes().splitlines(keepends=True) if file.exists() else []
        kept = lines[: epoch * len(self.seeds)]
        if len(kept) < epoch * len(self.seeds):
            raise self._damaged(f"{METRICS} ends before epoch {epoch}")
        if lines != kept:
            atomic.write_atomically(file, lambda part: part.write_bytes(b"".join(kept)))

    def _journaled(self) -> list[int]:
        """The epochs after which there is a journal, in order."""
        return sorted(int(file.stem) for file in (self.folder / JOURNALS).glob("[0-9]*.safetensors"))

    def _journal(self, epoch: int) -> Path:
        return self.folder / JOURNALS / f"{epoch:06d}.safetensors"

    def _damaged(self, why: object) -> DamagedFile:
        return DamagedFile(self.folder, why)
