"""Writes recordings beside the rollout, in processes of their own, so that the rollout does not wait for them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case
from dextron_bench.processes.limited_process import SINGLE_THREADED
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import recording_files

EACH = 12  # Recordings for each process, at least: a process takes as long to start as to write them, some 2 s.
AHEAD = 3  # Recordings for each process that are written or wait for it; with more, the rollout waits.
APART = {
    **SINGLE_THREADED,
    "PYTHONSAFEPATH": "1",  # Nothing is imported from the working folder.
    "PYTHONWARNINGS": "ignore:resource_tracker",  # Silent if this process is killed.
}
_SOURCE: list[Source] = []  # In a process that writes recordings: where their reaches come from.


class LostProcess(RuntimeError):
    """A process that writes recordings has ended too early."""


class Recorder:
    """A context manager that writes recordings of episodes of one source; after an error, those that wait are lost."""

    def __init__(self, source: Source, count: int, threads: int = 0) -> None:
        """Expects about `count` recordings. They are written in up to `threads` processes; 0 means one per processor.

        Few recordings are written in this process, and so are all with one thread.
        """
        processes = min(threads or _processors(), count // EACH)
        self._source, self._count = source, processes if processes > 1 else 0
        self._pool = _pool(source, self._count) if self._count else None
        self._writing = deque[tuple[Path, Future[str]]]()
        self._hashes: dict[Path, str] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool:
            self._pool.shutdown(cancel_futures=True)

    def write(self, file: Path, case: Case, episode: Episode, properties: dict[str, Any]) -> None:
        """Writes the recording of an episode, now or later, as `recording_files.write` does.

        Raises UnwritableRecording and LostProcess, also for earlier recordings.
        """
        if not self._pool:
            self._hashes[file] = recording_files.write(self._source, file, case, episode, properties)
            return
        if len(self._writing) == AHEAD * self._count:
            self._wait_for_first()
        with _naming_lost_processes(), _apart():
            self._writing.append((file, self._pool.submit(_write, file, case, episode, properties)))

    def hashes(self) -> dict[Path, str]:
        """The SHA-256 of each file, once all are written. Raises UnwritableRecording, LostProcess."""
        while self._writing:
            self._wait_for_first()
        return self._hashes

    def _wait_for_first(self) -> None:
        file, written = self._writing.popleft()
        with _naming_lost_processes():
            self._hashes[file] = written.result()


def _pool(source: Source, processes: int) -> ProcessPoolExecutor:
    """Processes that write recordings of a source; each starts when there is work for it."""
    with _apart():
        return ProcessPoolExecutor(processes, multiprocessing.get_context("spawn"), _begin, (source,))


@contextmanager
def _apart() -> Iterator[None]:
    """Processes that start in the block never receive Ctrl-C, and have the variables of APART."""
    before = dict(os.environ)
    os.environ |= APART
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]) if hasattr(signal, "pthread_sigmask") else None
    try:
        yield
    finally:
        for name in APART.keys() - before.keys():
            del os.environ[name]
        os.environ |= before
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def _naming_lost_processes() -> Iterator[None]:
    try:
        yield
    except BrokenProcessPool as error:
        raise LostProcess(
            "a process that writes recordings has ended; "
            "run the command again, with --threads 1 if this process alone shall write them"
        ) from error


def _begin(source: Source) -> None:
    """Prepares a process for recordings of a source; it ends with the process that started it, however that ends."""
    _SOURCE[:] = [source]
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(0)


def _write(*job: Any) -> str:
    return recording_files.write(_SOURCE[0], *job)


def _processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
