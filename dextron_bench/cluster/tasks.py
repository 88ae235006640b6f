"""A piece of work as a task for another machine: what it calls, what it needs, and what comes back."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dextron_bench.errors import BadInput, Failed
from dextron_bench.storage import atomic

RUNS, CACHE = "runs", "cache"  # The places of inputs begin so: the folder of runs, and the one for imported data.


class OtherVersion(BadInput):
    """A node whose code, data or packages differ from the driver's."""


class PieceFailed(Failed):
    """A piece, by the name of its task, that raised an error on its node, which another try would only repeat."""

    def __init__(self, task: str, why: str, node: str = "") -> None:
        super().__init__(f"{task}{f', on node {node}' if node else ''}: {why}")
        self.task = task


# What a task calls on its node: perform(runs, threads, **arguments). It does the piece in the folder `runs` and returns
# its files below that folder, in the order to write them in; what completes the piece is the last.
Perform = Callable[..., Sequence[Path]]


@dataclass(frozen=True, slots=True)
class Task:
    """One piece. `perform` is a function of a module, so that every installation has it.

    `inputs` are files by their place: `runs/...` below the node's folder of runs, `cache/...` below its folder for
    imported data. A task reserves `threads` processors and `gpus` GPUs.
    """

    name: str
    perform: Perform
    arguments: Mapping[str, Any]
    inputs: Mapping[str, Path] = field(default_factory=dict)
    threads: int = 1
    gpus: int = 0


@dataclass(frozen=True, slots=True)
class ResultFile:
    """A file that a task made: its path below the folder of runs, its SHA-256 and its content."""

    path: str
    sha256: str
    content: bytes


@dataclass(frozen=True, slots=True)
class Reply:
    """What a node sends back: files, or an error with its traceback; `is_refusal` if it has another version."""

    node: str
    files: tuple[ResultFile, ...] = ()
    error: str = ""
    traceback: str = ""
    is_refusal: bool = False


def content_hash(content: bytes) -> str:
    """SHA-256 of the content of a file."""
    return hashlib.sha256(content).hexdigest()


def write_files(files: Sequence[ResultFile], runs: Path) -> None:
    """Writes the files of a reply below the folder of runs, in their order; raises DamagedFile if bytes were lost."""
    for file in files:
        place = runs / file.path
        if content_hash(file.content) != file.sha256:
            raise atomic.DamagedFile(place, "it arrived with other bytes than it was sent with", "run again")
        atomic.write_atomically(place, lambda part, content=file.content: part.write_bytes(content))
