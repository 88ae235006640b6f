"""A process that is asked and answers by lines, and can neither hang nor outlive us."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

KEPT = ("PATH", "PYTHONPATH", "LANG", "LC_ALL", "SYSTEMROOT", "VIRTUAL_ENV")  # Of the environment.
ENDING = 5.0  # [s] that a process which has closed its output may take to end.
TAIL = 2000  # [bytes] of what an agent writes to its stderr that are looked at.


class Silent(RuntimeError):
    """A process from which no answer came."""


class Process:
    """A process that is asked by lines; threads read and write, so that neither side can hang us."""

    def __init__(self, words: Sequence[str], folder: str, room: int) -> None:
        """Starts it in a folder; its answers may have `room` bytes."""
        environment = {name: os.environ[name] for name in KEPT if name in os.environ}
        environment |= {"HOME": folder, "TMPDIR": folder, "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `kill`)
        self._popen = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            cwd=folder,
            env=environment,
            start_new_session=True,
        )
        self._questions: queue.Queue[bytes | None] = queue.Queue()
        self._answers: queue.Queue[bytes] = queue.Queue(2)  # One that is due, and one that tells of too many.
        self._room, self._over = room, False
        assert self._popen.stdin
        assert self._popen.stdout
        threading.Thread(target=self._write, args=(self._popen.stdin,), daemon=True).start()
        threading.Thread(target=self._read, args=(self._popen.stdout,), daemon=True).start()

    def ask(self, question: bytes, seconds: float) -> bytes:
        """The line that answers; raises Silent."""
        if not self._answers.empty():
            extra = self._answers.get()
            raise Silent(f"it wrote {len(extra)} bytes that nobody asked for" if extra else "it ended")
        self._questions.put(question)
        try:
            line = self._answers.get(timeout=seconds)
        except queue.Empty:
            raise Silent(f"it gave no answer within {seconds:g} s") from None
        if not line.endswith(b"\n"):
            raise Silent(f"its answer is longer than {self._room} bytes" if len(line) > self._room else "it ended")
        return line

    def epitaph(self, error: Exception) -> str:
        """What went wrong, with how the process ended and the last line that it wrote to stderr."""
        if str(error) == "it ended":
            try:
                code = self._popen.wait(ENDING)
            except subprocess.TimeoutExpired:
                code = None
            error = Silent(f"it ended with {_told(code)}")
        self._said.seek(max(0, self._said.seek(0, os.SEEK_END) - TAIL))
        lines = self._said.read().decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f"{error}: {last}" if last else str(error)

    def peak(self) -> int:
        """The most memory [bytes] that the process has held, 0 where the system does not tell."""
        try:
            return max(map(_peak, _family(self._popen.pid)))
        except (OSError, ValueError):
            return 0

    def kill(self) -> None:
        """Ends the process and what it started."""
        self._questions.put(None)
        self._over = True
        try:
            os.killpg(self._popen.pid, signal.SIGKILL)
        except (OSError, AttributeError):
            self._popen.kill()
        self._popen.wait()
        self._said.close()
        with suppress(queue.Empty):
            while True:  # So that the reader, which may wait for room, comes to its end.
                self._answers.get_nowait()

    def _write(self, pipe: IO[bytes]) -> None:
        try:
            while (question := self._questions.get()) is not None:
                pipe.write(question)
                pipe.flush()
            pipe.close()
        except OSError:
            pass  # It ended; the reader tells.

    def _read(self, pipe: IO[bytes]) -> None:
        with pipe:
            while not self._over and (line := pipe.readline(self._room + 1)):
                self._answers.put(line)
                if not line.endswith(b"\n"):
                    return
        if not self._over:
            self._answers.put(b"")


def _told(code: int | None) -> str:
    """How a process ended, from its exit code; a shell's for a signal is 128 and more."""
    number = -code if code is not None and code < 0 else code - 128 if code is not None and code > 128 else 0
    known = {each.value: each.name for each in signal.Signals}
    return f"signal {known[number]}" if number in known else f"code {code}"


def _family(process: int) -> list[int]:
    """A process and all that came of it."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return [process, *(each for child in children for each in _family(int(child)))]


def _peak(process: int) -> int:
    """The most memory [bytes] that a process has held."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")), 0)
