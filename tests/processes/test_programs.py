"""No process takes code from the working folder, which may hold files of a stranger."""

from __future__ import annotations

import ast
import os
import subprocess
from pathlib import Path

import pytest

import dextron_bench
from dextron_bench.processes import programs

PACKAGE = Path(dextron_bench.__file__).parent


@pytest.mark.slow
def test_one_module_alone_makes_the_command_of_a_python_process():
    users = [
        file.relative_to(PACKAGE).as_posix()
        for file in sorted(PACKAGE.rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and ast.unparse(node) == "sys.executable"
    ]
    assert users == ["processes/programs.py"]


def test_a_python_process_imports_nothing_from_the_working_folder(tmp_path: Path):
    (tmp_path / "random.py").write_text("print('planted')")
    for words in (("-c", "import random"), ("-m", "random")):
        done = subprocess.run(programs.python(*words), cwd=tmp_path, capture_output=True, check=False)
        assert b"planted" not in done.stdout


@pytest.mark.skipif(os.name != "posix", reason="executable bits")
def test_a_program_comes_from_an_absolute_folder_of_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """An empty entry of PATH, which many shells' start files add by mistake, is the working folder."""
    for folder in (tmp_path, tmp_path / "system"):
        folder.mkdir(exist_ok=True)
        (folder / "git").write_text("#!/bin/sh\n")
        (folder / "git").chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f":.:{tmp_path / 'system'}")
    assert programs.find("git") == str(tmp_path / "system" / "git")
    assert programs.find("bwrap") is None
