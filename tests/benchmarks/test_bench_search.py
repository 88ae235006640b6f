"""The cost of the search for experts, and what it saves by branching experts from one rollout."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from dextron_bench.experts import blocks, branching, montecarlo, outcomes
from dextron_bench.experts.montecarlo import Search
from dextron_bench.reaches.reach import Trajectory
from dextron_bench.reaches.recorded import cache
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.reaches.sources import open_source
from dextron_bench.world.engine import Engine
from tests.benchmarks.measure import Row, scaled, store_rows, time_in_turns, time_work
from tests.benchmarks.workload import default_source

SETTINGS, ROUNDS = 128, 2
PAPER = 1 / 90  # Rows with a return above 1 per second and thread on the paper's cluster.
THREADS = os.cpu_count() or 1
SEARCH = "Draws of a search, 8 experts from one rollout"


class TimedSource:
    """A source that sums the seconds it needs to make paths."""

    def __init__(self, source: Source) -> None:
        self._source, self.seconds = source, 0.0

    def path(self, setting: Setting) -> Trajectory:
        """The path of the source."""
        start = time.perf_counter()
        path = self._source.path(setting)
        self.seconds += time.perf_counter() - start
        return path


def play_draws(source: TimedSource, draws: pd.DataFrame, experts_per_rollout: int) -> np.ndarray:
    """Returns of all draws, with `experts_per_rollout` experts branching from one rollout."""
    engine = Engine(montecarlo.SLOTS, THREADS)
    batches = outcomes.batches(source, draws, experts_per_rollout)  # type: ignore[arg-type]  # It needs only paths.
    played = dict(branching.play(engine, batches))
    return np.concatenate([played[number].returns for number in range(len(played))])


def test_search_with_branching(benchmark: BenchmarkFixture):
    search = Search(default_source().name, block=scaled(SETTINGS))
    draws = montecarlo.draw(default_source(), search, 0)
    source, results = TimedSource(default_source()), []

    def branched() -> None:
        source.seconds = 0.0
        results.append(play_draws(source, draws, search.experts))

    def one_by_one() -> None:
        results.append(play_draws(TimedSource(default_source()), draws, 1))

    seconds, reference_seconds = time_in_turns(benchmark, branched, one_by_one, ROUNDS)
    assert all((returns == results[0]).all() for returns in results)
    rows = int((results[0] > blocks.KEPT).sum())
    store_rows(
        benchmark,
        *search_rows(len(draws), rows, seconds, reference_seconds),
        Row("Share of a search spent on paths", "", source.seconds / seconds),
    )


def search_rows(draws: int, kept: int, seconds: float, reference_seconds: float) -> list[Row]:
    """Lines of the table for a search that keeps `kept` of its draws."""
    against = "one rollout for each draw, the same draws"
    what, unit = f"Rows with a return above 1 ({kept} rows)", "rows/core-second"
    rate = kept / (seconds * THREADS)
    return [
        Row(SEARCH, "draws/s", draws / seconds, against, draws / reference_seconds),
        Row(what, unit, rate, against, kept / (reference_seconds * THREADS)),
        Row(what, unit, rate, "the paper's one in 90 thread-seconds", PAPER),
    ]


def test_open_recorded_reaches(
    benchmark: BenchmarkFixture, release: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path))
    cache.import_release(release)
    seconds = time_work(benchmark, lambda: open_source("real"), 5)
    store_rows(benchmark, Row("`open_source('real')` from the cache", "times/s", 1 / seconds))
