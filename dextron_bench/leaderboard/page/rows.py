"""The entries of the page's main table: the leaderboard's rows, how they were made, and rows quoted from the paper."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from dextron_bench.evaluation.declaration import Declaration
from dextron_bench.evaluation.results import Result, Training
from dextron_bench.methods import registry

TIERS = ("self-reported", "replayed", "re-run")  # From the least to the most verified.
QUOTED = "quoted"


@dataclass(frozen=True, slots=True, kw_only=True)
class PageRow:
    """A row of the table: `scores` has the leaderboard's columns; other fields are None if they are unknown.

    `role` names ceilings and floors, `frames` counts the training frames, `seconds` is the time of training,
    `privileged` names the declared access beyond the state. `equal` says how many episodes of a submission were equal
    bit for bit when they were replayed.
    """

    method: str
    reaches: str
    split: str
    tier: str
    scores: Mapping[Any, Any] = field(default_factory=dict)
    role: str | None = None
    note: str | None = None
    frames: int | None = None
    demonstrations: int | None = None
    seconds: float | None = None
    hardware: str | None = None
    privileged: str | None = None
    equal: str | None = None


# Numbers in the paper's text (sections Simulations, Results, Discussion); none is read off a figure.
PAPER = PageRow(
    method="RLIL 0.1",
    reaches="real",
    split="test",
    tier=QUOTED,
    scores={"return": 15.0, "success": 0.75, "seeds": 3},
    note="Sharif et al. 2021: its best method, on its own world and settings",
    frames=750_000,
    seconds=25 * 3600.0,
    hardware="one NVIDIA P100",
)


def entries(rows: pd.DataFrame, results: Iterable[Result]) -> list[PageRow]:
    """An entry for each of the leaderboard's rows, in their order; the paper's entry follows the rows of its split."""
    seeds: dict[tuple[str, str], list[Result]] = defaultdict(list)
    for result in results:
        seeds[result.method, result.reaches].append(result)
    table = [_entry(row, seeds[row["method"], row["reaches"]]) for row in rows.to_dict("records")]
    same_split = [k for k, entry in enumerate(table) if (entry.reaches, entry.split) == (PAPER.reaches, PAPER.split)]
    if same_split:
        table.insert(same_split[-1] + 1, PAPER)
    return table


def tier(results: Sequence[Result]) -> str:
    """How far a method's results were verified: the tier of the least verified seed."""
    tiers = [result.tier or TIERS[0] for result in results]
    return min(tiers, key=lambda name: TIERS.index(name) if name in TIERS else -1, default=TIERS[0])


def role(method: str) -> str | None:
    """`ceiling` or `floor` for a reference method, None for all others."""
    if method in registry.CEILINGS:
        return "ceiling"
    return "floor" if method in registry.FLOORS else None


def _entry(row: dict[Any, Any], results: Sequence[Result]) -> PageRow:
    trainings = [result.training or _declared_training(result) for result in results]
    return PageRow(
        method=row["method"],
        reaches=row["reaches"],
        split=row["split"],
        tier=tier(results),
        scores=row,
        role=role(row["method"]),
        note=_trained_by(row, trainings) or _authors(results),
        frames=_largest(training.frames for training in trainings),
        demonstrations=_largest(training.demonstrations for training in trainings),
        seconds=_largest(part.seconds for part in (*trainings, *(result.provenance for result in results))),
        hardware=" / ".join(dict.fromkeys(filter(None, map(_hardware, results)))) or None,
        privileged=_privileged(row["method"], results),
        equal=_equal(results),
    )


def _authors(results: Sequence[Result]) -> str | None:
    """Authors, notes and address of a submission, as declared."""
    declared = next((result.declared for result in results if result.declared), None)
    return " · ".join(filter(None, (declared.authors, declared.notes, declared.url))) or None if declared else None


def _declared_training(result: Result) -> Training:
    """The training that a submission declares, as a measured one."""
    declared = result.declared or Declaration()
    seconds = None if declared.hours is None else 3600.0 * declared.hours
    return Training(frames=declared.frames, demonstrations=declared.demonstrations, seconds=seconds)


def _trained_by(row: dict[Any, Any], trainings: Sequence[Training]) -> str | None:
    """Names the method and source that trained the policy, if it is not this row's own."""
    for training in trainings:
        label, reaches = training.label or row["method"], training.reaches or row["reaches"]
        if (label, reaches) != (row["method"], row["reaches"]):
            return f"policy of {label}, trained on {reaches}"
    return None


def _equal(results: Sequence[Result]) -> str | None:
    """How many episodes of a submission equal their replay bit for bit; None for other rows."""
    replays = [result.replay for result in results if result.replay]
    if not replays:
        return None
    equal, episodes = sum(replay.equal for replay in replays), sum(replay.episodes for replay in replays)
    return f"{equal:,} of {episodes:,} equal"


def _largest(values: Iterable[Any]) -> Any:
    return max((value for value in values if isinstance(value, int | float)), default=None)


def _hardware(result: Result) -> str | None:
    if result.declared:
        return result.declared.hardware or None
    machine = result.provenance.machine
    if not machine.cpu:
        return None
    return f"{machine.cpu}, {machine.cores} cores" if machine.cores else machine.cpu


def _privileged(method: str, results: Sequence[Result]) -> str | None:
    """The information beyond the state that the agent received, as declared."""
    accesses = [result.privileged for result in results if result.privileged]
    if any(result.declared and result.declared.privileged for result in results):
        accesses.append("more than the state, as declared")
    return accesses[0] if accesses else ("each setting's expert" if method in registry.CEILINGS else None)
