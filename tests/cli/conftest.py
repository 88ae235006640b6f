"""Fixtures of tests of the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from dextron_bench.cli import main


@pytest.fixture
def printed_json(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Runs a command with --json, which ends with code 0; returns what it prints."""

    def run(*words: str) -> Any:
        capsys.readouterr()
        assert main.main([*words, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return run
