"""Writes recordings beside the rollout, in processes of their own, so that the rollout does not wait for them."""

from __future__ import annotations

import json
import os
import pickle
import queue
import subprocess
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.experts.policies import Case
from dextron_bench.processes import programs
from dextron_bench.processes.limited_process import SINGLE_THREADED
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import recording_files

EACH = 12  # Recordings for each process, at least: a process takes as long to start as to write them, some 2 s.
AHEAD = 3  # Recordings for each process that are written or wait for it; with more, the rollout waits.
COMMAND = programs.python("-m", "dextron_bench.runs.recorder_process")


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
        self._processes: list[_Process] = []
        self._idle = queue.SimpleQueue[_Process]()
        self._threads = ThreadPoolExecutor(max(self._count, 1))  # Each waits for the answer of a process.
        self._writing = deque[tuple[Path, Future[str]]]()
        self._hashes: dict[Path, str] = {}

    def __enter__(self) -> Self:
        for _ in range(self._count):
            self._processes.append(_Process(self._source))
            self._idle.put(self._processes[-1])
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._threads.shutdown(cancel_futures=True)
        for process in self._processes:
            process.end()

    def write(self, file: Path, case: Case, episode: Episode, properties: dict[str, Any]) -> None:
        """Writes the recording of an episode, now or later, as `recording_files.write` does.

        Raises UnwritableRecording and LostProcess, also for earlier recordings.
        """
        if not self._count:
            self._hashes[file] = recording_files.write(self._source, file, case, episode, properties)
            return
        if len(self._writing) == AHEAD * self._count:
            self._wait_for_first()
        self._writing.append((file, self._threads.submit(self._write_beside, file, case, episode, properties)))

    def hashes(self) -> dict[Path, str]:
        """The SHA-256 of each file, once all are written. Raises UnwritableRecording, LostProcess."""
        while self._writing:
            self._wait_for_first()
        return self._hashes

    def _wait_for_first(self) -> None:
        file, written = self._writing.popleft()
        self._hashes[file] = written.result()

    def _write_beside(self, *job: Any) -> str:
        process = self._idle.get()
        try:
            return process.write(*job)
        finally:
            self._idle.put(process)


class _Process:
    """A process that writes one recording after the other."""

    def __init__(self, source: Source) -> None:
        environment = {**os.environ, **SINGLE_THREADED}
        self._popen = subprocess.Popen(  # In a session of its own, Ctrl-C does not reach it.
            COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, start_new_session=True
        )
        self._send(source)

    def write(self, file: Path, *job: Any) -> str:
        """The SHA-256 of a recording that is written; raises UnwritableRecording, LostProcess."""
        from dextron_bench.recording.rrd_file import UnwritableRecording  # Loads Rerun.

        self._send((file, *job))
        assert self._popen.stdout
        line = self._popen.stdout.readline()
        if not line.endswith(b"\n"):
            raise self._lost()
        answer: dict[str, str] = json.loads(line)
        if "error" in answer:
            raise UnwritableRecording(file, answer["error"])
        return answer["sha256"]

    def end(self) -> None:
        """Lets the process end, and waits until it has."""
        assert self._popen.stdin
        assert self._popen.stdout
        with suppress(BrokenPipeError):
            self._popen.stdin.close()
        self._popen.stdout.close()
        self._popen.wait()

    def _send(self, content: object) -> None:
        assert self._popen.stdin
        try:
            pickle.dump(content, self._popen.stdin)
            self._popen.stdin.flush()
        except BrokenPipeError as error:
            raise self._lost() from error

    def _lost(self) -> LostProcess:
        return LostProcess(
            f"a process that writes recordings has ended (code {self._popen.wait()}); "
            "run the command again, with --threads 1 if this process alone shall write them"
        )


def _processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
