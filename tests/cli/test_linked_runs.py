"""Runs on a second disk, reached by links: all commands see the same runs, and none is removed half."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.cli import main

PLACES = ["", "exp", "exp/synthetic", "exp/synthetic/seed0", "exp/synthetic/seed0/recordings"]


def link(here: Path, place: str) -> Path:
    """Moves a folder below runs/ to a second disk and links it by a relative path; returns where it is."""
    folder, there = here / "runs" / place, here / "disk" / "another-name"
    there.parent.mkdir()
    folder.rename(there)
    folder.symlink_to(os.path.relpath(there, folder.parent))
    return there


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    capsys.readouterr()
    assert main.main(list(words)) == 0
    return capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
def test_all_commands_see_the_runs_behind_a_link(
    place: str, two_runs: Path, capsys: pytest.CaptureFixture[str], printed_json: Callable[..., Any]
):
    commands = (("runs", "list"), ("recordings", "list"), ("browse",), ("leaderboard", "show"))
    before = [printed_json(*words) for words in commands]
    viewed = printed(capsys, "view", "--print", "--worst", "2", "--method", "exp", "--quiet")
    link(two_runs, place)
    after = [printed_json(*words) for words in commands]
    for row in (*before[0], *after[0]):
        del row["date"]  # Of the run's folder, which changes when a folder in it moves.
    assert after == before
    assert printed(capsys, "view", "--print", "--worst", "2", "--method", "exp", "--quiet") == viewed


@pytest.mark.parametrize("place", PLACES)
def test_an_archived_run_keeps_its_files_behind_a_link(place: str, two_runs: Path, capsys: pytest.CaptureFixture[str]):
    link(two_runs, place)
    printed(capsys, "runs", "archive", "exp/synthetic")
    seed = two_runs / "runs-archive/exp/synthetic/seed0"
    assert json.loads((seed / "result.json").read_text())["method"] == "exp"
    assert (seed / "recordings/test-0000.rrd").is_file()
    assert not os.path.lexists(two_runs / "runs/exp")
    assert (two_runs / "runs/nothing/synthetic/seed0/result.json").exists()


@pytest.mark.parametrize("place", PLACES)
def test_a_removed_run_leaves_no_link_and_nothing_half(place: str, two_runs: Path, capsys: pytest.CaptureFixture[str]):
    """What lies in another place than the folder of all runs stays, whole, and a line names it."""
    there = link(two_runs, place)
    files = sorted(there.rglob("*"))
    printed(capsys, "runs", "rm", "exp/synthetic", "--yes")
    assert not os.path.lexists(two_runs / "runs/exp")
    assert (two_runs / "runs/nothing/synthetic/seed0/result.json").exists()
    if place:
        assert sorted(there.rglob("*")) == files
        assert main.main(["runs", "rm", "exp/synthetic", "--yes"]) == 2


def test_one_of_several_runs_behind_a_link_is_not_removed(two_runs: Path, complaint: Callable[..., str]):
    there = link(two_runs, "exp")
    (there / "synthetic").rename(there / "real")
    os.symlink("real", there / "synthetic")
    line = complaint("runs", "rm", "exp/real", "--yes")
    assert "runs/exp is a link, and it has exp/synthetic too; name all of its runs, or none" in line
    assert (there / "real/seed0/result.json").exists()


@pytest.mark.slow
def test_links_that_lead_in_a_circle_end(two_runs: Path, capsys: pytest.CaptureFixture[str]):
    (two_runs / "runs/exp/around").symlink_to("..")
    (two_runs / "runs/first").symlink_to("second")
    (two_runs / "runs/second").symlink_to("first")
    count = len(json.loads(printed(capsys, "recordings", "list", "--json")))
    assert count == 2
    for words in (["runs", "list"], ["browse", "--json"], ["leaderboard", "show"], ["recordings", "list", "runs/exp"]):
        printed(capsys, *words)
    for words in (["view", "runs/first"], ["recordings", "list", "runs/first"], ["run", "--runs", "runs/first"]):
        assert main.main(words) == 2
