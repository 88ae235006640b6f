"""Fresh settings follow from a seed, lie on the split's reaches, and are solved by their experts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import branching
from dextron_bench.experts.branching import ExpertBatch, Outcomes
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits import fresh
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.world.engine import Engine
from tests.helpers import tiny_benchmark
from tests.helpers.short_reaches import SOURCE

ENGINE = Engine(1, 1)


def play(engine: Engine, batches: Iterable[ExpertBatch]) -> Iterator[tuple[int, Outcomes]]:
    """Instead of episodes: experts with a gain above 1.25 and a d_c from 0.2 to 0.5 succeed."""
    for number, batch in enumerate(batches):
        solves = (batch.gain > 1.25) & (batch.criticals > 0.2) & (batch.criticals < 0.5)
        yield number, Outcomes(np.where(solves, 20.0, 7.0), np.ones(len(solves), int))


@pytest.fixture(autouse=True)
def instant(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the simulation, except in slow tests."""
    if not request.node.get_closest_marker("slow"):
        monkeypatch.setattr(branching, "play", play)


def solved(seed: int, count: int = 150) -> pd.DataFrame:
    return fresh.solved(SOURCE.on_reaches("a"), count, seed, ENGINE)


def test_there_are_as_many_as_asked_for_on_the_reaches_only_with_an_expert_that_solves_each():
    """A block of 128 settings has about 64 with the gain, so several blocks are drawn for 150."""
    drawn = solved(7)
    assert len(drawn) == len(drawn.drop_duplicates(SETTING)) == 150
    assert set(drawn["reach"]) == {"a"}
    assert (drawn["gain"] > 1.25).all()
    assert drawn["critical"].between(0.2, 0.5).all()


def test_the_expert_of_a_setting_is_drawn_among_those_that_solve_it():
    """Not always the first: of the successful d_c, from 0.2 to 0.5, each third is taken about equally often."""
    counts, _ = np.histogram(solved(7)["critical"], bins=[0.2, 0.3, 0.4, 0.5])
    assert counts.min() > 30


def test_equal_seeds_draw_equal_settings_and_other_seeds_do_not():
    pd.testing.assert_frame_equal(solved(7, 20), solved(7).head(20))
    assert not set(solved(8)["offset_x"]) & set(solved(7)["offset_x"])


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Splits `val`, `test` and `unseen-reach` of two reaches."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path), monkeypatch.setattr)
    yield
    tiny_benchmark.forget()


def test_fresh_splits_have_reaches_of_the_same_distribution(tiny: None):
    """`test` has reaches a and b; `unseen-reach` has b only."""
    drawn = {split.name: split for split in fresh.draw("synthetic", 7, ENGINE, 30)}
    assert list(drawn) == ["test", "unseen-reach"]
    reaches = {name: {case.setting.reach for case in split.cases} for name, split in drawn.items()}
    assert reaches == {"test": {"a", "b"}, "unseen-reach": {"b"}}
    assert [len(split) for split in drawn.values()] == [30, 30]
    others = {split.name: split.digest for split in fresh.draw("synthetic", 8, ENGINE, 30)}
    assert all(others[name] != split.digest for name, split in drawn.items())


def test_minjerk_has_no_fresh_settings():
    with pytest.raises(BadInput, match="are not drawn by a search"):
        fresh.draw("minjerk", 0, ENGINE, 2)


@pytest.mark.slow
def test_experts_solve_fresh_settings_of_a_shipped_split(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(fresh, "BLOCK", 16)
    source = open_source("synthetic")
    monkeypatch.setattr(fresh, "ranking_splits", lambda reaches: ("test",))
    [drawn] = fresh.draw("synthetic", 0, Engine(128, 2), 3)
    assert [episode.score for _, episode in rollout(ExpertAgent(), source, drawn)] == [20.0] * 3
    assert not {case.setting.reach for case in drawn.cases} & set(source.names)  # Its reaches are new.
