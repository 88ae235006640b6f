"""A process that reads files of strangers ends when it takes too much memory or time; its output stays."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dextron_bench.processes import limited_process
from dextron_bench.processes.limited_process import GIBIBYTE


def run(file: Path, code: str, *arguments: str, content: bytes = b"", seconds: float = 60.0) -> limited_process.Outcome:
    file.write_text(code)
    return limited_process.run(str(file), arguments, content, GIBIBYTE, seconds)


def test_a_script_receives_arguments_and_input(tmp_path: Path):
    done = run(
        tmp_path / "a.py", "import sys\ndef main(*words): print(words, sys.stdin.read())", "x", "y z", content=b"in"
    )
    assert (done.output.split(b"\n")[0].strip(), done.code) == (b"('x', 'y z') in", 0)


@pytest.mark.skipif(sys.platform != "linux", reason="the system does not limit the address space")
def test_memory_is_limited(tmp_path: Path):
    done = run(tmp_path / "a.py", "def main(): print(1, flush=True); b'x' * (2 << 30)")
    assert done.output.strip() == b"1"
    assert "MemoryError" in done.errors
    assert done.ending == "ended with code 1"


def test_time_is_limited(tmp_path: Path):
    done = run(tmp_path / "a.py", "def main():\n  print(1, flush=True)\n  while True: pass", seconds=0.5)
    assert (done.output.strip(), done.code, done.ending) == (b"1", None, "took too long")


@pytest.mark.skipif(sys.platform != "linux", reason="the system does not limit the address space")
def test_what_imports_reserve_does_not_count(tmp_path: Path):
    """Rerun reserves 6 GB on 64 processors, and a file is not at fault for that."""
    reserving = "import mmap\nreserved = mmap.mmap(-1, 3 << 30)\n"
    done = run(tmp_path / "a.py", f"{reserving}def main(): print(len(b'x' * (1 << 29)))")
    assert (done.output.strip(), done.code) == (b"536870912", 0)
    done = run(tmp_path / "a.py", f"{reserving}def main(): b'x' * (1 << 30)")
    assert "MemoryError" in done.errors


def test_a_script_that_cannot_be_imported_blames_no_file(tmp_path: Path):
    with pytest.raises(limited_process.NotStarted, match=r"files cannot start: nothing here$"):
        run(tmp_path / "a.py", "raise SystemExit('nothing here')")


@pytest.mark.skipif(sys.platform != "linux", reason="the system does not limit the address space")
def test_a_limit_of_the_user_is_named_if_it_is_too_low(tmp_path: Path):
    """With `ulimit -v`, imports fail with errors that do not say why."""
    (tmp_path / "a.py").write_text("import mmap; mmap.mmap(-1, 1 << 30)\ndef main(): ...")
    code = f"""
import resource
from dextron_bench.processes import limited_process
resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
limited_process.run({str(tmp_path / "a.py")!r}, [], b"", 1, 1.0)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "`ulimit -v` allows 1.0 GiB of address space; raise it" in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="the system does not limit the address space")
def test_a_higher_limit_of_the_user_stays(tmp_path: Path):
    code = "import resource\ndef main(): print(resource.getrlimit(resource.RLIMIT_AS)[1])"
    (tmp_path / "a.py").write_text(code)
    outer = f"""
import resource
from dextron_bench.processes import limited_process
resource.setrlimit(resource.RLIMIT_AS, (3 << 29, 3 << 29))
print(limited_process.run({str(tmp_path / "a.py")!r}, [], b"", 1 << 33, 9.0).output)
"""
    done = subprocess.run([sys.executable, "-c", outer], capture_output=True, text=True, check=True)
    assert str(3 << 29) in done.stdout
