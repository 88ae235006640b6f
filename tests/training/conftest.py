"""The tiny benchmark of every test of training."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from dextron_bench.storage import provenance
from dextron_bench.training import learning_curve
from tests.helpers import tiny_benchmark, tiny_training


@pytest.fixture(autouse=True)
def tiny_splits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Tiny splits, scores without a simulation, and a provenance that does not depend on the commit."""
    tiny_training.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "abc"})
    monkeypatch.setattr(learning_curve, "rollout", tiny_training.artificial_scores)
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)
    yield
    tiny_benchmark.forget()
