"""Compares the result of a submission with the result computed from its episodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from msgspec import to_builtins

from dextron_bench.evaluation.results import Result
from dextron_bench.storage import provenance
from dextron_bench.storage.provenance import Provenance

RETURN_TOLERANCE = 0.2  # Largest difference of a mean return, of 20, on another platform.


def same_platform(claimed: Provenance) -> bool:
    """True if a provenance names the platform of this machine: episodes must then be equal bit for bit.

    Two processors of one name may have other vector extensions, with which the C library computes other last bits. A
    provenance without a platform gets no tolerance.
    """
    here = provenance.collect(physics="")
    if not (claimed.machine.cpu and claimed.machine.system and "mujoco" in claimed.versions):
        return True
    extensions = [claimed.machine.extensions, here.machine.extensions]
    alike = None in extensions or extensions[0] == extensions[1]
    versions = claimed.versions["mujoco"] == here.versions["mujoco"]
    systems = provenance.system_of(claimed.machine) == provenance.system_of(here.machine)
    return versions and claimed.machine.cpu == here.machine.cpu and alike and systems


def differences(result: Result, computed: Result) -> Iterator[str]:
    """A line for each entry of a result that differs from the computed result."""
    for name in ("method", "reaches", "seed", "provenance"):
        claim, fact = getattr(result, name), getattr(computed, name)
        if claim != fact:
            yield f"its result says {name} {claim!r}, not {fact!r}"
    if result.declared not in (None, computed.declared):
        yield "its result has other declarations than its manifest"
    for split in sorted(result.splits.keys() | computed.splits.keys()):
        claims, facts = (to_builtins(part.splits.get(split)) or {} for part in (result, computed))
        for name in sorted(claims.keys() | facts.keys()):
            if claims.get(name) != facts.get(name):
                row = _first_difference(claims.get(name), facts.get(name))
                yield f"its result has {name} on {split} that its episodes do not give{row}"


def distant_returns(result: Result, computed: Result) -> Iterator[str]:
    """A line for each split whose mean return differs from the computed one by more than RETURN_TOLERANCE.

    Splits that only one of both has are left out; `differences` names them.
    """
    for split in sorted(result.splits.keys() & computed.splits.keys()):
        claimed, replayed = (float(np.mean(part.splits[split].scores)) for part in (result, computed))
        if abs(claimed - replayed) > RETURN_TOLERANCE:
            yield f"its result has a mean return of {claimed:.2f} on {split}; played again it is {replayed:.2f}"


def _first_difference(claimed: Any, computed: Any) -> str:
    """The first row in which two lists differ, in brackets; empty if they are not lists of equal length."""
    if not isinstance(claimed, list) or not isinstance(computed, list) or len(claimed) != len(computed):
        return ""
    row = int(np.flatnonzero([first != second for first, second in zip(claimed, computed, strict=True)])[0])
    return f" (row {row}: {claimed[row]}, not {computed[row]})"
