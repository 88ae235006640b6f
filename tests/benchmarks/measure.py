"""How benchmarks measure: two ways of one piece of work turn about, so that a busy machine slows both alike."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from pytest_benchmark.fixture import BenchmarkFixture

SCALE = float(os.environ.get("DEXTRON_BENCH_SCALE", "1"))  # Of all amounts of work; small ones only try the code out.


@dataclass(frozen=True)
class Row:
    """A line of the table: a rate [unit], what it is held against [same unit], and the ratio aimed for."""

    what: str
    unit: str
    rate: float
    against: str = ""
    against_rate: float | None = None
    aim: float | None = None


def scaled(amount: int) -> int:
    """An amount of work at this run's scale, 4 at least."""
    return max(4, round(amount * SCALE))


def in_turns(
    benchmark: BenchmarkFixture, work: Callable[[], Any], reference: Callable[[], Any], rounds: int
) -> tuple[float, float]:
    """Medians over rounds of the seconds that `work` and, right before each, `reference` take."""
    mine, others = [], []

    def before() -> None:
        others.append(clocked(reference))

    benchmark.pedantic(lambda: mine.append(clocked(work)), setup=before, rounds=rounds, iterations=1)
    return median(mine), median(others)


def alone(benchmark: BenchmarkFixture, work: Callable[[], Any], rounds: int) -> float:
    """Median over rounds of the seconds that `work` takes."""
    mine: list[float] = []
    benchmark.pedantic(lambda: mine.append(clocked(work)), rounds=rounds, iterations=1)
    return median(mine)


def clocked(work: Callable[[], Any]) -> float:
    """Seconds that `work` takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def note(benchmark: BenchmarkFixture, *rows: Row) -> None:
    """Keeps lines of the table beside the benchmark's own numbers."""
    benchmark.extra_info["rows"] = [asdict(row) for row in rows]
    benchmark.extra_info["scale"] = SCALE
