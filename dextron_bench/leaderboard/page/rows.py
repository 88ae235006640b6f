"""What the page's main table says: the leaderboard's rows, what is known of how they were made, and quoted ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from dextron_bench.methods import registry

TIERS = ("self-reported", "replayed", "re-run")  # The least checked first.
QUOTED = "quoted"
Result = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Entry:
    """A row: `scores` as the leaderboard's columns name them, the rest None where it is not known.

    `role` says what is no entrant; `frames` that it learned from, `seconds` of training, `privileged` access declared.
    """

    method: str
    reaches: str
    split: str
    tier: str
    scores: dict[str, Any] = field(default_factory=dict)
    role: str | None = None
    note: str | None = None
    frames: int | None = None
    demonstrations: int | None = None
    seconds: float | None = None
    hardware: str | None = None
    privileged: str | None = None


# What the paper says in numbers (sections Simulations, Results, Discussion); nothing is read off its figures.
PAPER = Entry(
    "RLIL 0.1",
    "real",
    "test",
    QUOTED,
    {"return": 15.0, "success": 0.75, "seeds": 3},
    note="Sharif et al. 2021: its best method, on its own world and settings",
    frames=750_000,
    seconds=25 * 3600.0,
    hardware="one NVIDIA P100",
)


def entries(rows: pd.DataFrame, results: Iterable[Result]) -> list[Entry]:
    """An entry for each of the leaderboard's rows in their order, and the paper's after those of its split."""
    seeds: dict[tuple[str, str], list[Result]] = defaultdict(list)
    for result in results:
        seeds[result["method"], result["reaches"]].append(result)
    found = [_entry(row, seeds[row["method"], row["reaches"]]) for row in rows.to_dict("records")]
    beside = [place for place, each in enumerate(found) if (each.reaches, each.split) == (PAPER.reaches, PAPER.split)]
    if beside:
        found.insert(beside[-1] + 1, PAPER)
    return found


def tier(results: Sequence[Result]) -> str:
    """How far a method's results were checked: as far as the least checked of its seeds."""
    told = [str(result.get("tier") or TIERS[0]) for result in results]
    return min(told, key=lambda each: TIERS.index(each) if each in TIERS else -1, default=TIERS[0])


def role(method: str) -> str | None:
    """What a method is that is no entrant."""
    if method in registry.CEILINGS:
        return "ceiling"
    return "floor" if method in registry.FLOORS else None


def _entry(row: dict[Any, Any], results: Sequence[Result]) -> Entry:
    training = [result.get("training") or _declared(result) for result in results]
    return Entry(
        row["method"],
        row["reaches"],
        row["split"],
        tier(results),
        row,
        role(row["method"]),
        _learned_elsewhere(row, training) or _authors(results),
        _largest(each.get("frames") for each in training),
        _largest(each.get("demonstrations") for each in training),
        _largest(
            [*(each.get("seconds") for each in training), *(each["provenance"].get("seconds") for each in results)]
        ),
        " / ".join(dict.fromkeys(filter(None, map(_machine, results)))) or None,
        _privileged(row["method"], results),
    )


def _authors(results: Sequence[Result]) -> str | None:
    """Whose a submission is, with what they say of it."""
    told = [each["declared"] for each in results if each.get("declared")]
    return (
        " · ".join(filter(None, (told[0].get(name) for name in ("authors", "notes", "url")))) or None if told else None
    )


def _declared(result: Result) -> dict[str, Any]:
    """What the authors of a submission say of its training, as results of ours have it."""
    told = result.get("declared") or {}
    hours = told.get("hours")
    known = {name: told.get(name) for name in ("frames", "demonstrations")}
    return known | {"seconds": None if hours is None else 3600.0 * hours}


def _learned_elsewhere(row: dict[Any, Any], training: Sequence[dict[str, Any]]) -> str | None:
    """Whose policy it is, for a method that takes another's."""
    for each in training:
        label, reaches = each.get("label", row["method"]), each.get("reaches", row["reaches"])
        if (label, reaches) != (row["method"], row["reaches"]):
            return f"policy of {label}, trained on {reaches}"
    return None


def _largest(values: Iterable[Any]) -> Any:
    return max((value for value in values if isinstance(value, int | float)), default=None)


def _machine(result: Result) -> str | None:
    if "declared" in result:
        return str(result["declared"].get("hardware") or "") or None
    machine = result["provenance"].get("machine") or {}
    if not machine.get("cpu"):
        return None
    return f"{machine['cpu']}, {machine['cores']} cores" if machine.get("cores") else str(machine["cpu"])


def _privileged(method: str, results: Sequence[Result]) -> str | None:
    """What an agent was given beside the state, as was declared."""
    told = [str(result["privileged"]) for result in results if result.get("privileged")]
    told += ["more than the state, as declared" for each in results if (each.get("declared") or {}).get("privileged")]
    return told[0] if told else ("each setting's expert" if method in registry.CEILINGS else None)
