"""What the search for experts costs, and what sharing the opening saves."""

from __future__ import annotations

import os
import time
from pathlib import Path as File

import numpy as np
import pandas as pd
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from dextron_bench.experts import blocks, branching, montecarlo
from dextron_bench.experts.montecarlo import Search
from dextron_bench.reaches.reach import Path
from dextron_bench.reaches.recorded import cache
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.reaches.sources import open_source
from dextron_bench.world.engine import Engine
from tests.benchmarks.measure import Row, alone, in_turns, note, scaled
from tests.benchmarks.workload import reaches

SETTINGS, ROUNDS = 128, 2
PAPER = 1 / 90  # Rows above 1 for each second of one thread of the paper's cluster.
THREADS = os.cpu_count() or 1


class Clocked:
    """A source that adds up the seconds spent on making paths."""

    def __init__(self, source: Source) -> None:
        self._source, self.seconds = source, 0.0

    def path(self, setting: Setting) -> Path:
        """As the source itself."""
        began = time.perf_counter()
        path = self._source.path(setting)
        self.seconds += time.perf_counter() - began
        return path


def scores(source: Clocked, draws: pd.DataFrame, experts_each: int) -> np.ndarray:
    """Sums of rewards of all draws, `experts_each` to an opening."""
    engine = Engine(montecarlo.SLOTS, THREADS)
    asked = montecarlo.batches(source, draws, experts_each)  # type: ignore[arg-type]  # It only asks for paths.
    found = dict(branching.play(engine, asked))
    return np.concatenate([found[number].returns for number in range(len(found))])


def test_search_with_shared_openings(benchmark: BenchmarkFixture):
    search = Search(reaches().name, block=scaled(SETTINGS))
    draws = montecarlo.draw(reaches(), search, 0)
    source, kept = Clocked(reaches()), []

    def shared() -> None:
        source.seconds = 0.0
        kept.append(scores(source, draws, search.experts))

    def naive() -> None:
        kept.append(scores(Clocked(reaches()), draws, 1))

    seconds, one_by_one = in_turns(benchmark, shared, naive, ROUNDS)
    assert all((found == kept[0]).all() for found in kept)
    rows = int((kept[0] > blocks.KEPT).sum())
    rate = rows / (seconds * THREADS)
    against = "one episode a draw, the same draws"
    note(
        benchmark,
        Row("Draws of a search, 8 to an opening", "draws/s", len(draws) / seconds, against, len(draws) / one_by_one),
        Row(f"Rows above 1 ({rows} found)", "rows/core-second", rate, against, rows / (one_by_one * THREADS)),
        Row(f"Rows above 1 ({rows} found)", "rows/core-second", rate, "the paper's one in 90 thread-seconds", PAPER),
        Row("Share of a search spent on paths", "", source.seconds / seconds),
    )


def test_open_recorded_reaches(
    benchmark: BenchmarkFixture, release: File, tmp_path: File, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("DEXTRON_CACHE", str(tmp_path))
    cache.import_release(release)
    seconds = alone(benchmark, lambda: open_source("real"), 5)
    note(benchmark, Row("`open_source('real')` from the cache", "times/s", 1 / seconds))
