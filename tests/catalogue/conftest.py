"""The tiny benchmark of every test of runs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from dextron_bench.storage import provenance
from tests.helpers import tiny_benchmark


@pytest.fixture(autouse=True)
def tiny_splits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Tiny splits of short reaches, and a provenance that does not depend on the commit."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "abc"})
    yield
    tiny_benchmark.forget()
