"""The commands of a first hour under the conditions of other machines: each must end with code 0, or say what is wrong.

Conditions that need another system are tried by `.ci/machines`.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers import conditions, tiny_training
from tests.helpers.tiny_benchmark import COMMAND

pytestmark = pytest.mark.slow

TOY = tiny_training.TOY
RECORDING = "runs/reflex/synthetic/seed0/recordings/val-0000.rrd"
COMMANDS = (
    "list",
    "check reflex",
    "run --method reflex --split val --record 1 --quiet",
    "recordings list",
    f"recordings export {RECORDING} --into picture.gif --width 64 --height 48 --quiet",
    f"run --method {TOY} --preset smoke --split val --record 0 --quiet",
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
    ["no_flock,no_folder_fsync", "no_fcntl,no_fsync,no_links", "no_exclusive,no_modes,no_mmap", "no_name,process_one"],
)
def test_file_systems_and_users(names: str, tmp_path: Path):
    all_work(tmp_path, conditions.environment(*names.split(",")) | {"TMPDIR": str(tmp_path)})


@pytest.mark.parametrize("redirection", ["<&-", ">&-", "2>&-"])
def test_streams_that_are_closed(redirection: str, tmp_path: Path):
    all_work(tmp_path, dict(os.environ), redirection)


def test_a_locale_without_utf8(tmp_path: Path):
    latin = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    all_work(tmp_path, latin)
    for words in ("--help", "run --help"):
        done = run(words, tmp_path, latin)
        assert (done.returncode, done.stderr) == (0, "")


def test_runs_behind_links(tmp_path: Path):
    (tmp_path / "disk").mkdir()
    here = tmp_path / "here"
    here.mkdir()
    (here / "runs").symlink_to("../disk")
    all_work(here, dict(os.environ))
    assert (tmp_path / "disk/reflex/synthetic/seed0/result.json").exists()


@pytest.mark.skipif(not shutil.which("script"), reason="`script` gives a command a terminal (Debian: bsdutils)")
def test_tables_fit_a_terminal_of_80_columns(tmp_path: Path):
    environment = {**os.environ, "TERM": "xterm"}
    for words in COMMANDS:
        command = f'stty cols 80; "{sys.executable}" "{COMMAND}" data {words}'
        done = subprocess.run(
            ["script", "-qec", command, "/dev/null"], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout
        lines = re.sub(r"\x1b\[[\d;]*m", "", done.stdout).splitlines()
        rows = [line for line in lines if line.startswith(("│", "┃"))]
        assert all(len(line.rstrip()) <= 80 for line in rows)
        assert rows or words not in ("list", "recordings list", COMMANDS[2])
