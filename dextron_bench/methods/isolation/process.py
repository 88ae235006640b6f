"""A process that answers questions line by line; it can neither block the benchmark nor outlive it."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from typing import IO

from dextron_bench.errors import Failed
from dextron_bench.methods.isolation import usage
from dextron_bench.storage.printable import printable

ENVIRONMENT = ("PATH", "PYTHONPATH", "LANG", "LC_ALL", "SYSTEMROOT", "VIRTUAL_ENV")  # Variables that a process keeps.
EXIT_TIMEOUT = 5.0  # [s] that a process may take to end after it has closed its output.
PERIOD = 0.1  # [s] between two measurements of memory and disk.
MOST_PROCESSES = 64
STDERR_TAIL = 2000  # [bytes] at the end of stderr in which the last line is searched.
LAST_LINE = 500  # Characters of that line that a message shows; a table of episodes in a bundle has short texts only.


class NoAnswer(Failed):
    """The process gave no answer; the message says why."""


class Process:
    """A process that answers lines with lines. Threads read and write, so that neither side blocks the benchmark."""

    def __init__(self, command: Sequence[str], folder: str, max_answer: int, memory: int = 0, disk: int = 0) -> None:
        """Starts the command in a folder; an answer may have `max_answer` bytes.

        It ends if it and its children use more than `memory` [bytes] together, or their folder more than `disk`
        [bytes]; 0 sets no limit.
        """
        environment = {name: os.environ[name] for name in ENVIRONMENT if name in os.environ}
        environment |= {"HOME": folder, "TMPDIR": folder, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `kill`)
        self._popen = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            cwd=folder,
            env=environment,
            start_new_session=True,
        )
        self._questions: queue.Queue[bytes | None] = queue.Queue()
        self._answers: queue.Queue[bytes] = queue.Queue(2)  # The expected answer, and one more to detect a surplus.
        self._max_answer, self._killed = max_answer, False
        self._folder, self._memory, self._disk = folder, memory, disk
        self._excess = ""  # What it used too much of.
        self._ended = threading.Event()
        assert self._popen.stdin
        assert self._popen.stdout
        threading.Thread(target=self._write, args=(self._popen.stdin,), daemon=True).start()
        threading.Thread(target=self._read, args=(self._popen.stdout,), daemon=True).start()
        if memory or disk:
            threading.Thread(target=self._watch, daemon=True).start()

    def ask(self, question: bytes, seconds: float) -> bytes:
        """The line that answers a question; raises NoAnswer if the process ends or no line comes in time."""
        if not self._answers.empty():
            surplus = self._answers.get()
            raise NoAnswer(f"it wrote {len(surplus)} bytes that nobody asked for" if surplus else "it ended")
        self._questions.put(question)
        try:
            line = self._answers.get(timeout=seconds)
        except queue.Empty:
            raise NoAnswer(f"it gave no answer within {seconds:g} s") from None
        if not line.endswith(b"\n"):
            too_long = f"its answer is longer than {self._max_answer} bytes"
            raise NoAnswer(too_long if len(line) > self._max_answer else "it ended")
        return line

    def describe_failure(self, error: Exception) -> str:
        """The error, how the process ended if it did, and the end of its last line on stderr, printable."""
        if self._excess:
            return self._excess
        if str(error) == "it ended":
            try:
                code = self._popen.wait(EXIT_TIMEOUT)
            except subprocess.TimeoutExpired:
                code = None
            error = NoAnswer(f"it ended with {_describe_exit(code)}")
        self._stderr.seek(max(0, self._stderr.seek(0, os.SEEK_END) - STDERR_TAIL))
        lines = self._stderr.read().decode(errors="replace").split("\n")
        last = printable(next((line.strip() for line in reversed(lines) if line.strip()), ""))[-LAST_LINE:]
        return f"{error}: {last}" if last else str(error)

    def peak_memory(self) -> int:
        """The highest use of memory [bytes] of the process or a child, 0 if the system does not report it."""
        return max(map(usage.peak_memory, usage.process_tree(self._popen.pid)))

    def kill(self) -> None:
        """Ends the process and its children."""
        self._questions.put(None)
        self._killed = True
        self._ended.set()
        self._end()
        self._popen.wait()
        self._stderr.close()
        with suppress(queue.Empty):
            while True:  # The reader may wait for room in the queue; emptying the queue lets it end.
                self._answers.get_nowait()

    def _end(self) -> None:
        try:
            os.killpg(self._popen.pid, signal.SIGKILL)
        except (OSError, AttributeError):
            self._popen.kill()

    def _watch(self) -> None:
        """Ends the process when it uses too much."""
        while not self._ended.wait(PERIOD) and not self._excess:
            tree = usage.process_tree(self._popen.pid)
            if self._memory and (used := usage.memory(tree)) > self._memory:
                self._excess = f"it used {used / 2**20:.0f} MiB of memory, more than {self._memory / 2**20:.0f}"
            elif self._disk and (used := usage.disk(self._folder)) > self._disk:
                self._excess = f"it wrote {used / 2**20:.0f} MiB of files, more than {self._disk / 2**20:.0f}"
            elif len(tree) > MOST_PROCESSES:
                self._excess = f"it started {len(tree)} processes, more than {MOST_PROCESSES}"
            if self._excess and not self._killed:
                self._end()

    def _write(self, pipe: IO[bytes]) -> None:
        try:
            while (question := self._questions.get()) is not None:
                pipe.write(question)
                pipe.flush()
            pipe.close()
        except OSError:
            pass  # The process ended; the reader reports it.

    def _read(self, pipe: IO[bytes]) -> None:
        with pipe:
            while not self._killed and (line := pipe.readline(self._max_answer + 1)):
                self._answers.put(line)
                if not line.endswith(b"\n"):
                    return
        if not self._killed:
            self._answers.put(b"")


def _describe_exit(code: int | None) -> str:
    """How a process ended: its exit code or a signal's name; a shell reports signal n as code 128 + n."""
    number = -code if code is not None and code < 0 else code - 128 if code is not None and code > 128 else 0
    names = {one.value: one.name for one in signal.Signals}
    return f"signal {names[number]}" if number in names else f"code {code}"
