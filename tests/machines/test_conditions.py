"""The commands of a first hour under the conditions of other machines: each must end with code 0, or say what is wrong.

Two conditions take two minutes; the others are tried with `--thorough`, and those that need another
system by `.ci/machines`.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers import conditions, many_processors, tiny_training
from tests.helpers.tiny_benchmark import COMMAND

pytestmark = pytest.mark.slow
thorough = pytest.mark.thorough

TOY = tiny_training.TOY
RECORDING = "runs/reflex/synthetic/seed0/recordings/val-0000.rrd"
COMMANDS = (
    "runs methods",
    "check reflex",
    "run --method reflex --split val --record 1 --quiet",
    "recordings list",
    f"recordings export {RECORDING} --into picture.gif --width 64 --height 48 --quiet",
    f"run --method {shlex.quote(TOY)} --preset smoke --split val --record 0 --quiet",
    "runs export --into exported",
)


def run(
    words: str, folder: Path, environment: dict[str, str], redirection: str = ""
) -> subprocess.CompletedProcess[str]:
    """Runs one command of the tiny benchmark through a shell in a folder."""
    command = f'"{sys.executable}" "{COMMAND}" data {words} {redirection}'
    return subprocess.run(
        ["sh", "-c", command], cwd=folder, env=environment, capture_output=True, text=True, errors="replace"
    )


def all_work(folder: Path, environment: dict[str, str], redirection: str = "") -> None:
    """Runs all commands in a folder one after the other."""
    for words in COMMANDS:
        done = run(words, folder, environment, redirection)
        assert done.returncode == 0, f"{words}: code {done.returncode}: {done.stderr}{done.stdout}"
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "names",
    [
        "no_flock,no_folder_fsync,no_name,process_one",
        pytest.param("no_fcntl,no_fsync,no_links,no_exclusive,no_modes,no_mmap", marks=thorough),
    ],
)
def test_file_systems_and_users(names: str, tmp_path: Path):
    all_work(tmp_path, conditions.environment(*names.split(",")) | {"TMPDIR": str(tmp_path)})


@thorough
@pytest.mark.parametrize("redirection", ["<&- 2>&-", ">&-"])
def test_streams_that_are_closed(redirection: str, tmp_path: Path):
    all_work(tmp_path, dict(os.environ), redirection)


@thorough
@pytest.mark.parametrize("count", [64, 128])
def test_many_processors(count: int, tmp_path: Path):
    all_work(tmp_path, many_processors.environment(tmp_path, count))


@thorough
@pytest.mark.parametrize("charset", ["ASCII", "ISO-8859-1"])
def test_a_locale_without_utf8(charset: str, tmp_path: Path):
    variables = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    if charset != "ASCII":
        made = subprocess.run(["localedef", "-i", "en_US", "-f", charset, tmp_path / "en_US"], capture_output=True)
        if made.returncode > 1:  # 1 is a warning.
            pytest.skip("a locale of Latin-1 is made from the sources of locales (Debian: locales)")
        variables |= {"LC_ALL": "en_US", "LOCPATH": str(tmp_path)}
    environment = {**os.environ, **variables}
    encoding = [sys.executable, "-c", "import locale; print(locale.getencoding())"]
    assert subprocess.check_output(encoding, env=environment, text=True).strip() in (charset, "ANSI_X3.4-1968", "646")
    all_work(tmp_path, environment)
    for words in ("--help", "run --help"):
        done = run(words, tmp_path, environment)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not shutil.which("script"), reason="`script` gives a command a terminal (Debian: bsdutils)")
def test_runs_behind_a_link_and_tables_in_a_terminal_of_80_columns(tmp_path: Path):
    (tmp_path / "disk").mkdir()
    here = tmp_path / "here"
    here.mkdir()
    (here / "runs").symlink_to("../disk")
    environment = {**os.environ, "TERM": "xterm"}
    for words in COMMANDS:
        command = f'stty cols 80; "{sys.executable}" "{COMMAND}" data {words}'
        done = subprocess.run(
            ["script", "-qec", command, "/dev/null"], cwd=here, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout
        lines = re.sub(r"\x1b\[[\d;]*m", "", done.stdout).splitlines()
        rows = [line for line in lines if line.startswith(("│", "┃"))]
        assert all(len(line.rstrip()) <= 80 for line in rows)
        assert rows or words not in ("runs methods", "recordings list", COMMANDS[2])
    assert (tmp_path / "disk/reflex/synthetic/seed0/result.json").exists()
