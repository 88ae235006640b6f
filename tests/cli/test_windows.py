"""`windows` through the real command line: a picture, a table, and errors in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from dextron_bench.cli import main


@pytest.mark.slow
def test_the_choices_of_a_rule_and_of_the_expert_are_drawn(tiny_world: Path, capsys: pytest.CaptureFixture[str]):
    words = ["windows", "reflex", "--split", "val", "--threads", "1", "--quiet", "--into", "pictures/windows.svg"]
    assert main.main(words) == 0
    printed = capsys.readouterr().out
    assert all(word in printed for word in ("closing works [s]", "expert [s]", "reflex [s]", "pictures/windows.svg"))
    (row,) = [line for line in printed.splitlines() if line.startswith("│")]
    _, number, reach, works, expert, _, _ = (cell.strip() for cell in row.split("│"))
    assert (number, reach) == ("0", "b")
    first, last = map(float, works.split(" to "))
    assert first < last
    assert "some closing works in 1 of 1 settings; success: expert in 1, reflex in " in printed
    assert "x" not in expert  # The row's expert scores 20.
    assert (tiny_world / "pictures/windows.svg").read_text().startswith("<?xml")


def test_an_error_is_one_line(tiny_world: Path, complaint: Callable[..., str]):
    assert "--rows must be 1 or more, not 0" in complaint("windows", "--rows", "0")
    assert "no picture format '.gif'" in complaint("windows", "--into", "windows.gif")
    assert "no method 'nix'" in complaint("windows", "nix")
    assert "No such file" in complaint("windows", "nix.safetensors")


@pytest.mark.slow
def test_only_failures_are_shown_if_wanted(
    tiny_world: Path, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]
):
    words = ["windows", "--split", "val", "--threads", "1", "--quiet", "--failed", "--into", "windows.svg"]
    assert main.main([*words, "nothing", "exp"]) == 0
    printed = capsys.readouterr().out
    (row,) = [line for line in printed.splitlines() if line.startswith("│")]
    assert row.split("│")[5].strip() == "nan x"
    assert "success: expert in 1, nothing in 0, exp in 1" in printed
    assert "no agent failed in any of the 1 settings" in complaint(*words, "exp")
