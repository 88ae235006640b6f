"""Standard streams that are closed, full, left by their reader, without UTF-8, or shared with what agents print."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.cli import main
from dextron_bench.cli.support import output
from tests.helpers import tiny_benchmark

ROOT = Path(__file__).parents[2]
TABLES = """
import sys
from dextron_bench.cli import main
from dextron_bench.cli.runs import methods
from dextron_bench.cli.support import output
def call(self):
    for _ in range(2):
        output.print_table("a table \\u2013 with a dash", ["a", "b"], [[1, "\\u00e9"]])
    return 0
methods.Methods.__call__ = call
sys.exit(main.main())
"""
LOUD = """
import ctypes, os, sys
print("imported")
class Mine:
    name = "mine"
    def agent(self, seed):
        print("made")
        os.write(1, b"by its descriptor\\n")
        ctypes.CDLL(None).puts(b"from C")
        return self
    def reset(self, episodes): ...
    def act(self, states):
        return -states[:, :1] ** 0
"""
LATIN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
METHODS = ["runs", "methods"]


def start(*words: str, code: str = TABLES, shell: str = "", **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Runs the command line in a new process, with buffers as users have them; `shell` redirects its streams."""
    inherited = {name: value for name, value in os.environ.items() if name not in ("PYTHONUNBUFFERED", "COLUMNS")}
    command = [sys.executable, "-c", code, *words]
    if shell:
        command = ["/bin/bash", "-c", f'"$@" {shell}', "bash", *command]
    return subprocess.run(
        command, env={**inherited, "PYTHONPATH": str(ROOT), **environment}, capture_output=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("words", [METHODS, ["--help"], ["run", "--help"], ["--version"], [*METHODS, "--json"]])
def test_a_reader_that_leaves_is_no_error(words: list[str]):
    """Rich ends the process with code 1 if it is the first to notice, and Python at its end with code 120."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    command = [sys.executable, "-c", TABLES, *words]
    environment = {**inherited, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        errors = process.stderr.read()
    if words == ["runs", "methods", "--json"]:
        assert (errors.count(b"\n"), process.returncode) == (
            1,
            2,
        )  # It has no JSON: a wrong flag stays one.
    else:
        assert (errors, process.returncode) == (b"", 0)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is full")
def test_a_full_disk_behind_stdout_is_one_line():
    done = start("runs", "methods", shell=">/dev/full")
    assert (done.returncode, done.stderr) == (2, b"dextron-bench: No space left on device\n")
    assert start("runs", "methods", shell="2>/dev/full").returncode == 0
    assert start("nosuch", shell="2>/dev/full").returncode == 2


@pytest.mark.slow
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_stream_is_one_that_leads_nowhere(closed: str, tmp_path: Path):
    """The next file that is opened would otherwise get its number, and what is printed."""
    done = start("runs", "methods", shell=closed)
    assert (done.returncode, done.stderr) == (0, b"")
    assert start("nosuch", shell=closed).returncode == 2
    done = start("runs", "rm", "x", "--runs", str(tmp_path), shell=closed)
    assert done.returncode == 2
    assert b"Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("words", [["runs", "methods"], ["--help"], ["run", "--help"], ["runs", "list", "--help"]])
def test_a_locale_without_utf_8_gets_escapes_and_no_error(words: list[str]):
    done = start(*words, **LATIN)
    assert (done.returncode, done.stderr) == (0, b"")
    done.stdout.decode("ascii")
    if words == ["runs", "methods"]:
        assert b"a table \\u2013 with a dash" in done.stdout
        assert b"| 1 | \\xe9 |" in done.stdout


def test_a_name_that_the_locale_lacks_is_blamed_on_the_locale():
    done = start("runs", "list", "--runs", "r\u00e9sultats", **LATIN)
    assert done.returncode == 2
    assert b"has letters that this locale lacks; set LC_ALL=C.UTF-8" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("more", [{"COLUMNS": "40"}, {"COLUMNS": "abc"}, {"TERM": "dumb"}, {"NO_COLOR": "1"}])
def test_the_size_and_kind_of_a_terminal_change_no_exit_code(more: dict[str, str]):
    for words in (["runs", "methods"], ["--help"]):
        done = start(*words, **more)
        assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.slow
def test_json_stands_alone_on_stdout_though_the_agent_prints(tiny_world: Path):
    (tiny_world / "mine.py").write_text(LOUD)
    words = ["run", "--method", "mine.py:Mine", "--split", "test", "--quiet", "--record", "0", "--json"]
    process = tiny_benchmark.start(tiny_world / "data", *words)
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0
    assert [row["method"] for row in json.loads(out)] == ["mine"]
    assert {"imported", "made", "by its descriptor", "from C"} <= set(errors.splitlines())


def test_numbers_that_are_not_finite_are_null(capsys: pytest.CaptureFixture[str]):
    output.print_json({"a": [float("nan"), 1.0], "b": (float("inf"),)})
    assert json.loads(capsys.readouterr().out) == {"a": [None, 1.0], "b": [None]}


def test_a_damaged_character_in_a_text_names_the_word_alone():
    error = UnicodeEncodeError("utf-8", 'a long text with "runs/r\udcff" in it', 23, 24, "surrogates not allowed")
    assert main.explain(error) == (2, "'runs/r\\udcff' is not valid UTF-8; rename the file or folder")


@pytest.mark.parametrize("command", ["leaderboard", "view", "browse"])
def test_a_port_that_is_taken_is_named(
    command: str, two_runs: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]
):
    import socket

    from dextron_bench import recording

    monkeypatch.setattr(recording, "web_viewer_files", dict, raising=False)
    (two_runs / "leaderboard").mkdir()
    (two_runs / "leaderboard" / "index.html").touch()
    words: dict[str, list[Any]] = {"leaderboard": ["leaderboard", "serve"]}
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        line = complaint(*words.get(command, [command, "--web"]), "--port", port)
    assert f"port {port}: Address already in use; choose another with --port, or --port 0 for a free one" in line
