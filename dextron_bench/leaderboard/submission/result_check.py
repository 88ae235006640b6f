"""What a submission's result says, beside what its episodes give, and whether bits can be held against it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from dextron_bench.storage import provenance


def same_platform(told: dict[str, Any]) -> bool:
    """Whether a provenance is of a machine like this one, on which episodes must be equal bit for bit."""
    here = provenance.collect(physics="")
    try:
        versions = told["versions"]["mujoco"] == here["versions"]["mujoco"]
        return versions and told["machine"]["cpu"] == here["machine"]["cpu"] and _kind(told) == _kind(here)
    except (KeyError, TypeError):
        return True  # Whoever does not say is held to the bits.


def _kind(told: dict[str, Any]) -> str:
    return str(told["machine"]["system"]).partition("-")[0]


def differences(result: dict[str, Any], computed: dict[str, Any]) -> Iterator[str]:
    """Where a result is not what its episodes give."""
    for name in ("method", "reaches", "seed", "provenance"):
        if result[name] != computed[name]:
            yield f"its result says {name} {result[name]!r}, not {computed[name]!r}"
    for split in sorted(result["splits"].keys() | computed["splits"].keys()):
        told, found = result["splits"].get(split, {}), computed["splits"].get(split, {})
        for name in sorted(told.keys() | found.keys()):
            if told.get(name) != found.get(name):
                where = _first(told.get(name), found.get(name))
                yield f"its result has {name} on {split} that its episodes do not give{where}"


def _first(told: Any, found: Any) -> str:
    """The first place where two lists of scores part."""
    if not isinstance(told, list) or not isinstance(found, list) or len(told) != len(found):
        return ""
    row = int(np.flatnonzero([a != b for a, b in zip(told, found, strict=True)])[0])
    return f" (row {row}: {told[row]}, not {found[row]})"
