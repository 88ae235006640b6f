"""The processes that read files of strangers, as copies of one that has imported what they need.

A copy takes a hundredth of the time of a new process; it has the same limits and can end in the same ways. How a
process starts is tested in tests/processes.
"""

from __future__ import annotations

import io
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn, cast

from dextron_bench.processes import limited_process, limited_start
from dextron_bench.processes.limited_process import Outcome
from dextron_bench.recording import reader_process
from dextron_bench.submissions import bundle, table_process

TARGETS = (reader_process.__file__, table_process.__file__, bundle.JSON_PROCESS)


@contextmanager
def installed() -> Iterator[None]:
    """Replaces `limited_process.run` where it reads files; other modules and scripts start as ever."""
    start, readers = limited_process.run, _Readers()

    def run(target: str, arguments: Sequence[str], content: bytes, memory: int, seconds: float) -> Outcome:
        ask: Callable[..., Outcome] = readers.run if target in TARGETS else start
        return ask(target, arguments, content, memory, seconds)

    limited_process.run = run
    try:
        yield
    finally:
        limited_process.run = start
        readers.end()


class _Readers:
    """The process that is copied; it starts with the first question."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def run(self, *question: Any) -> Outcome:
        if not self._process:
            environment = {**os.environ, **limited_process.SINGLE_THREADED}
            command = [sys.executable, "-m", __name__]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, start_new_session=True
            )
        assert self._process.stdin
        assert self._process.stdout
        pickle.dump((os.getcwd(), *question), self._process.stdin)
        self._process.stdin.flush()
        return pickle.load(self._process.stdout)

    def end(self) -> None:
        if self._process:
            self._process.communicate()


def _end_with(function: Callable[..., int | None], arguments: Sequence[str]) -> NoReturn:
    """Calls the function and ends this process at once: to clear what it has imported takes a second."""
    code = 1
    try:
        sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w")  # noqa: SIM115
        code = function(*arguments) or 0
        sys.stdout.flush()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def main() -> None:
    """Answers each question on standard input with an Outcome on standard output."""
    loaded = {target: limited_start._load(target) for target in TARGETS}
    questions, answers = cast(io.BufferedReader, sys.stdin.buffer), sys.stdout.buffer
    while questions.peek(1):
        folder, target, arguments, content, memory, seconds = pickle.load(questions)
        with tempfile.TemporaryFile() as given, tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
            given.write(content)
            given.seek(0)
            child = os.fork()
            if not child:
                for number, file in enumerate((given, output, errors)):
                    os.dup2(file.fileno(), number)
                os.chdir(folder)
                limited_start._limit_memory(memory)
                limited_start._limit_time(seconds)
                _end_with(loaded[target].main, arguments)
            code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            output.seek(0)
            errors.seek(0)
            answer = Outcome(
                output.read(), errors.read().decode(errors="replace"), None if code == -signal.SIGALRM else code
            )
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main()
