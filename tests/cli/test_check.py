"""The command that `check` prints at its end; its checks are tested in tests/leaderboard/submission."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dextron_bench.cli.check import Check


@dataclass(frozen=True)
class Settings:
    near: float = 0.05
    gain: float = 1.0


def test_the_command_that_submits_has_what_was_checked():
    """With the default limits the agent that passes with others would be stopped."""
    settings = Settings(near=0.1)
    checked = Check("a.py:A", "real", Path("w.safetensors"), 30.0, 8.0, trust=True, method_settings=settings)
    assert checked.submission() == (
        "dextron-bench submit a.py:A --near 0.1 --reaches real --weights w.safetensors "
        "--timeout 30.0 --memory 8.0 --trust --name NAME"
    )


def test_defaults_are_left_out():
    assert Check("a.py:A", threads=2).submission() == "dextron-bench submit a.py:A --name NAME"
