"""Results from plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dextron_bench.evaluation.results import Result
from dextron_bench.storage import records

SPLIT: dict[str, Any] = {"digest": "d", "scores": [1.0], "failed": 0, "causes": {}, "closing_lag": None}


def result(
    method: str = "a", seed: int = 0, reaches: str = "real", splits: Mapping[str, Any] | None = None, **more: Any
) -> Result:
    """A result; what a split does not say is as in SPLIT, and it has the split `test` if none is given."""
    by_name = {name: SPLIT | part for name, part in (splits or {"test": {}}).items()}
    content = {"method": method, "reaches": reaches, "seed": seed, "splits": by_name, **more}
    return records.convert(content, Result)
