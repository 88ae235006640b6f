"""Fixtures of tests of isolated agents."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.helpers.isolated_play import write_agent


@pytest.fixture
def agent_spec(tmp_path: Path) -> Callable[[str], str]:
    """Writes an agent whose `act` is one line; returns its spec."""
    return partial(write_agent, tmp_path)
