"""Processes that answer lines: an ended process is reported at once, and its threads end."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

import pytest

from dextron_bench.methods.isolation.process import NoAnswer, Process

ONCE = "print(input()); raise SystemExit(7)"
FLOOD = "while True: print('more', flush=True)"


def start(script: str, here: Path) -> Process:
    return Process([sys.executable, "-c", script], str(here), max_answer=100)


def test_a_process_that_ended_between_two_questions_is_reported_at_once(tmp_path: Path):
    process = start(ONCE, tmp_path)
    assert process.ask(b"first\n", 60.0) == b"first\n"
    while process._popen.poll() is None or process._answers.empty():
        time.sleep(0.01)
    with pytest.raises(NoAnswer, match="it ended") as caught:
        process.ask(b"second\n", 10_000.0)
    assert process.describe_failure(caught.value) == "it ended with code 7"
    process.kill()


def test_the_threads_of_a_process_that_writes_too_much_end_with_it(tmp_path: Path):
    before = threading.active_count()
    process = start(FLOOD, tmp_path)
    while not process._answers.full():
        time.sleep(0.01)
    with pytest.raises(NoAnswer, match="it wrote 5 bytes that nobody asked for"):
        process.ask(b"first\n", 60.0)
    process.kill()
    deadline = time.monotonic() + 60.0
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() <= before


def test_the_last_line_of_a_failed_process_is_short_and_printable(tmp_path: Path):
    """A bundle with a longer text, or with one that drives a terminal, is refused."""
    process = start("import sys; sys.exit('x' * 900 + '\x1b[2J' + 'y' * 100)", tmp_path)
    with pytest.raises(NoAnswer, match="it ended") as caught:
        process.ask(b"first\n", 60.0)
    message = process.describe_failure(caught.value)
    assert message == "it ended with code 1: " + "x" * 393 + "\\x1b[2J" + "y" * 100
    process.kill()
