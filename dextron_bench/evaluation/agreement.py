"""Compares our world with outcomes on another hand: plays the same settings and experts, and counts equal successes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches import setting
from dextron_bench.splits.rows import Rows
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import task

RETURN = "return_on_mesh_hand"
NUMBERS = ("duration_noise", "offset_x", "offset_y", "gain", "critical_distance", RETURN)
UNIFORM = "uniform"  # The stratum that is drawn as the search draws; most of its rows fail on any hand.
HARD = f"all but {UNIFORM}"


def read(file: Path) -> pd.DataFrame:
    """The outcomes in a CSV file, with the columns `reach`, `stratum` and NUMBERS; raises BadInput, OSError."""
    try:
        table = pd.read_csv(file, dtype=str)
    except ValueError as error:  # Also a file that is empty or not UTF-8.
        raise BadInput(f"{file}: is not a CSV file ({error})") from error
    missing = [name for name in ("reach", "stratum", *NUMBERS) if name not in table]
    if missing:
        raise BadInput(f"{file}: has no column {missing[0]!r}; outcomes need reach, stratum, {', '.join(NUMBERS)}")
    for name in NUMBERS:
        table[name] = table[name].map(_number).astype(float)
    usable = np.isfinite(table[list(NUMBERS)].to_numpy(float)).all(axis=1)
    usable &= table[["reach", "stratum"]].notna().to_numpy().all(axis=1)
    if table.empty or not usable.all():
        where = "has no rows" if table.empty else f"line {np.argmin(usable) + 2}: a value is missing or not a number"
        raise BadInput(f"{file}: {where}")
    return table


def _number(text: object) -> float:
    """The number in a cell, which is NaN if it has none."""
    try:
        return float(str(text))
    except ValueError:
        return float("nan")


def play(outcomes: pd.DataFrame, source: setting.Source, progress: Progress = no_progress) -> np.ndarray:
    """Our returns (rows,), 0 to 20, of the settings and experts of the outcomes. Raises UnknownReach, BadInput."""
    experts = zip(outcomes["gain"], outcomes["critical_distance"], strict=True)
    settings = setting.from_frame(outcomes)
    cases = [Case(one, Expert(gain, critical), 0.0) for one, (gain, critical) in zip(settings, experts, strict=True)]
    returns = np.zeros(len(cases))
    for count, (number, episode) in enumerate(rollout(ExpertAgent(), source, Rows(cases=tuple(cases))), start=1):
        returns[number] = episode.score
        progress(count, len(cases))
    return returns


def by_stratum(outcomes: pd.DataFrame, returns: np.ndarray) -> pd.DataFrame:
    """The agreement of our returns (rows,) with the outcomes: a row per stratum, and one for all but UNIFORM.

    Columns: stratum; rows; `agreement`, the share of rows with equal success, and `standard_error`; `same_return`, the
    share with the same return; `theirs` and `ours`, the success rates; `only_theirs` and `only_ours`, counts of rows.
    """
    theirs = outcomes[RETURN].to_numpy() == task.SUCCESS
    ours = returns == task.SUCCESS
    compared = pd.DataFrame(
        {
            "stratum": outcomes["stratum"].to_numpy(),
            "agreement": theirs == ours,
            "same_return": outcomes[RETURN].to_numpy() == returns,
            "theirs": theirs,
            "ours": ours,
            "only_theirs": theirs & ~ours,
            "only_ours": ours & ~theirs,
        }
    )
    hard = compared[compared["stratum"] != UNIFORM].assign(stratum=HARD)
    parts = [*compared.groupby("stratum"), *([(HARD, hard)] if len(hard) else [])]
    return pd.DataFrame([_summary(str(name), part) for name, part in parts])


def _summary(stratum: str, part: pd.DataFrame) -> dict[str, object]:
    share = float(part["agreement"].mean())
    return {
        "stratum": stratum,
        "rows": len(part),
        "agreement": share,
        "standard_error": float(np.sqrt(share * (1.0 - share) / len(part))),
        **{name: float(part[name].mean()) for name in ("same_return", "theirs", "ours")},
        **{name: int(part[name].sum()) for name in ("only_theirs", "only_ours")},
    }
