"""The check of pull requests: whatever a pull request adds, only plain bundles are read, and each is verified."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / ".ci" / "verify-submissions"
VERIFIER = """#!/bin/sh
echo "$@" >> "$LOG"
case "$*" in *bad.zip*) exit 1;; esac
"""
pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("bash", "git", "unzip"))), reason="bash, git or unzip is not installed"
)


def bundle(file: Path, reaches: str = "synthetic") -> None:
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("bundle.json", f'{{"reaches": "{reaches}"}}')


@pytest.fixture
def verify(tmp_path: Path) -> Callable[[Callable[[Path], object]], tuple[int, str, list[str]]]:
    """Commits what a function adds to `submissions/` and verifies it: exit code, stderr, and the verifier's calls."""
    checkout, programs, log = tmp_path / "repository", tmp_path / "bin", tmp_path / "log"
    programs.mkdir()
    (programs / "dextron-bench").write_text(VERIFIER)
    (programs / "dextron-bench").chmod(0o755)
    path = f"{programs}{os.pathsep}{os.environ['PATH']}"
    environment = {"PATH": path, "LOG": str(log), "RUNNER_TEMP": str(tmp_path), "HOME": str(tmp_path)}

    def git(*words: str) -> None:
        command = ["git", "-c", "user.name=a", "-c", "user.email=a@example.org", "-C", str(checkout), *words]
        subprocess.run(command, check=True, capture_output=True, env=environment)

    def run(add: Callable[[Path], object]) -> tuple[int, str, list[str]]:
        (checkout / "submissions").mkdir(parents=True)
        git("init", "-q")
        git("commit", "-q", "--allow-empty", "-m", "base")
        git("branch", "base")
        add(checkout / "submissions")
        git("add", "-A")
        git("commit", "-q", "-m", "a submission")
        git("branch", "theirs")
        git("checkout", "-q", "base")
        done = subprocess.run(
            [SCRIPT, "base", "theirs"], cwd=checkout, env=environment, capture_output=True, text=True, check=False
        )
        calls = log.read_text().splitlines() if log.exists() else []
        return done.returncode, done.stderr, [re.sub(r"/\S*/", "", call) for call in calls]

    return run


def test_every_bundle_is_verified_and_looked_at_for_the_data_that_it_needs(verify: Callable):
    def add(folder: Path) -> None:
        bundle(folder / "a.zip")
        bundle(folder / "bad.zip")
        bundle(folder / "c.zip", "real")

    code, _, calls = verify(add)
    assert code == 1  # Of bad.zip; the one after it is verified, too.
    verified = [f"leaderboard verify {name} --board leaderboard" for name in ("a.zip", "bad.zip", "c.zip")]
    assert calls == ["data fetch", *verified]


def test_a_good_bundle_passes(verify: Callable):
    assert verify(lambda folder: bundle(folder / "a-1.zip")) == (
        0, "", ["leaderboard verify a-1.zip --board leaderboard"]
    )  # fmt: skip


@pytest.mark.parametrize("name", ["a b.zip", "-d.zip", "a\nb.zip", "$(touch x).zip", "x.txt", "folder/a.zip", "*.zip"])
def test_names_that_a_shell_could_misread_are_refused(name: str, verify: Callable):
    def add(folder: Path) -> None:
        (folder / name).parent.mkdir(exist_ok=True)
        bundle(folder / name)

    code, error, calls = verify(add)
    assert (code, calls) == (1, [])
    assert "not the name of a bundle" in error


def test_links_are_refused(verify: Callable):
    code, error, calls = verify(lambda folder: (folder / "a.zip").symlink_to("/etc/passwd"))
    assert (code, calls) == (1, [])
    assert "not a plain file" in error


def test_a_list_of_bundles_in_the_pull_request_is_not_used(verify: Callable):
    def add(folder: Path) -> None:
        (folder.parent / "bundles.txt").symlink_to("/etc/passwd")

    code, error, calls = verify(add)
    assert (code, calls) == (1, [])
    assert "adds no bundle" in error


def test_the_verdict_comes_from_the_base_branch_and_no_text_of_the_event_is_part_of_a_command():
    workflows = ROOT / ".github" / "workflows"
    arrived, verdict = ((workflows / f"{name}.yml").read_text() for name in ("submissions", "submissions-verdict"))
    assert "checkout" not in arrived
    assert "permissions: {}" in arrived
    assert "workflow_run:" in verdict
    assert "pull_request_target" not in verdict
    commands = re.findall(r"run: (?:>-\n)?((?:.*\n)(?: {10,}.*\n)*)", verdict)
    assert len(commands) == 4
    assert not [command for command in commands if "${{" in command]
