"""How each cell of the leaderboard is written: the same in the terminal, in the README and on the page.

A row is a mapping with the columns of `standings.table`. A missing or NaN value gives an empty cell.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dextron_bench.evaluation.diagnosis import CAUSES

Row = Mapping[Any, Any]
SMALLEST_P = 1e-10


@dataclass(frozen=True, slots=True)
class Score:
    """A score as text, and its 95 % interval as text; the interval is empty if it is unknown."""

    value: str
    interval: str = ""

    def __str__(self) -> str:
        return f"{self.value} {self.interval}".rstrip()


def counted(number: int, noun: str) -> str:
    """A number with its noun, such as "1 seed" and "3 seeds"."""
    return f"{number} {noun}" + ("s" if number != 1 else "")


def p_value(p: float) -> str:
    """A p value with two digits; of very small ones only that they are small, since no test is that exact."""
    return f"{p:.2g}" if p >= SMALLEST_P else f"<{SMALLEST_P:g}"


def rank(row: Row) -> str:
    """The rank, as a whole number."""
    return _number(row.get("rank"), 0)


def mean_return(row: Row) -> Score:
    """Mean return, 0 to 20."""
    return _score(row, "return", 2)


def success(row: Row) -> Score:
    """Success rate [%]."""
    return _score(row, "success", 1, 100.0)


def interquartile_mean(row: Row) -> Score:
    """Interquartile mean of the return, 0 to 20."""
    return _score(row, "iqm", 2)


def score(row: Row) -> Score:
    """The score of a round [%]."""
    return _score(row, "score", 1, 100.0)


def regret(row: Row) -> str:
    """How much more EXP scores than the method."""
    return _number(row.get("regret"), 2)


def share(row: Row, split: str) -> str:
    """The share of a split's settings that a method solves in a round [%]."""
    return _number(row.get(split), 1, 100.0)


def cause_shares(row: Row) -> list[str]:
    """Share of episodes [%] that end by each of CAUSES."""
    return [f"{100 * row[cause] / row['episodes']:.1f}" for cause in CAUSES]


def closing_lag(row: Row) -> str:
    """Time [s] from the expert's closing to the method's; negative is too early."""
    return _number(row.get("closing_lag"), 2)


def _score(row: Row, name: str, digits: int, unit: float = 1.0) -> Score:
    low, high = (_number(row.get(f"{name}{end}"), digits, unit) for end in ("_low", "_high"))
    return Score(_number(row.get(name), digits, unit), f"[{low}, {high}]" if low and high else "")


def _number(value: float | None, digits: int, unit: float = 1.0) -> str:
    return "" if value is None or math.isnan(value) else f"{unit * value:.{digits}f}"
