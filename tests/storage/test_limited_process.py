"""A process that reads files of strangers ends when it takes too much memory or time; its output stays."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from dextron_bench.storage import limited_process
from dextron_bench.storage.limited_process import GIBIBYTE


def run(file: Path, code: str, *arguments: str, content: bytes = b"", seconds: float = 60.0) -> limited_process.Outcome:
    file.write_text(code)
    return limited_process.run(str(file), arguments, content, GIBIBYTE, seconds)


def test_a_script_receives_arguments_and_input(tmp_path: Path):
    done = run(tmp_path / "a.py", "import sys; print(sys.argv[1:], sys.stdin.read())", "x", "y z", content=b"in")
    assert (done.output.split(b"\n")[0].strip(), done.code) == (b"['x', 'y z'] in", 0)


@pytest.mark.skipif(sys.platform != "linux", reason="the system does not limit the address space")
def test_memory_is_limited(tmp_path: Path):
    done = run(tmp_path / "a.py", "print(1, flush=True); b'x' * (2 << 30)")
    assert done.output.strip() == b"1"
    assert "MemoryError" in done.errors
    assert done.ending == "ended with code 1"


def test_time_is_limited(tmp_path: Path):
    done = run(tmp_path / "a.py", "print(1, flush=True)\nwhile True: pass", seconds=3.0)
    assert (done.output.strip(), done.code, done.ending) == (b"1", None, "took too long")
