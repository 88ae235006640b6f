"""The command that `check` prints at its end; its checks are tested in tests/leaderboard/submission."""

from __future__ import annotations

from pathlib import Path

from dextron_bench.cli.check import Check


def test_the_command_that_submits_has_what_was_checked():
    """With the default limits the agent that passes with others would be stopped."""
    checked = Check("a.py:A", "real", Path("w.safetensors"), '{"near": 0.1}', timeout=30.0, memory=8.0, trust=True)
    assert checked.submission() == (
        "dextron-bench submit a.py:A --reaches real --weights w.safetensors --settings '{\"near\": 0.1}' "
        "--timeout 30.0 --memory 8.0 --trust --name NAME"
    )


def test_defaults_are_left_out():
    assert Check("a.py:A", threads=2).submission() == "dextron-bench submit a.py:A --name NAME"
