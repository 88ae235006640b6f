"""Timing of benchmarks: two ways of doing the same work take turns, so that other load slows both equally."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from pytest_benchmark.fixture import BenchmarkFixture

SCALE = float(os.environ.get("DEXTRON_BENCH_SCALE", "1"))  # Factor of all work; small values test the code.


@dataclass(frozen=True)
class Row:
    """A line of the table: a rate [unit], the rate it is compared with [same unit], and the intended ratio."""

    what: str
    unit: str
    rate: float
    against: str = ""
    against_rate: float | None = None
    aim: float | None = None


def scaled(amount: int) -> int:
    """An amount of work times SCALE, at least 4."""
    return max(4, round(amount * SCALE))


def time_in_turns(
    benchmark: BenchmarkFixture, work: Callable[[], Any], reference: Callable[[], Any], rounds: int
) -> tuple[float, float]:
    """Medians over rounds of the seconds of `work`, and of `reference`, which runs before `work` in each round."""
    work_seconds, reference_seconds = list[float](), list[float]()

    def time_reference() -> None:
        reference_seconds.append(time_once(reference))

    benchmark.pedantic(lambda: work_seconds.append(time_once(work)), setup=time_reference, rounds=rounds, iterations=1)
    return median(work_seconds), median(reference_seconds)


def time_work(benchmark: BenchmarkFixture, work: Callable[[], Any], rounds: int) -> float:
    """Median over rounds of the seconds of `work`."""
    seconds: list[float] = []
    benchmark.pedantic(lambda: seconds.append(time_once(work)), rounds=rounds, iterations=1)
    return median(seconds)


def time_once(work: Callable[[], Any]) -> float:
    """Seconds of one call of `work`."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def store_rows(benchmark: BenchmarkFixture, *rows: Row) -> None:
    """Stores lines of the table in the JSON of pytest-benchmark."""
    benchmark.extra_info["rows"] = [asdict(row) for row in rows]
    benchmark.extra_info["scale"] = SCALE
