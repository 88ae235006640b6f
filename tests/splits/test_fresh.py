"""Fresh settings follow from a seed, lie on the split's reaches, and are solved by their experts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pytest

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import branching
from dextron_bench.experts.branching import ExpertBatch, Outcomes
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches.setting import Setting
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits import fresh
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.world.engine import Engine
from tests.helpers.short_reaches import SOURCE

CASES = (Case(Setting("a", 0.0, 0.0, 0.0), Expert(1.2, 0.3), 0.1),) * 150
SPLIT = Split("test", "brief", CASES, "0" * 64)
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


def test_there_are_as_many_as_in_the_split_on_its_reaches_only_with_an_expert_that_solves_each():
    """A block of 128 settings has about 64 with the gain, so several blocks are drawn for 150."""
    drawn = fresh.draw(SOURCE, SPLIT, 7, ENGINE)
    assert (drawn.name, drawn.reaches, len(drawn.cases)) == ("test", "brief", 150)
    assert {case.setting.reach for case in drawn.cases} == {"a"}
    assert len({case.setting for case in drawn.cases}) == 150
    assert all(case.expert.gain > 1.25 and 0.2 < case.expert.critical < 0.5 for case in drawn.cases)


def test_the_expert_of_a_setting_is_drawn_among_those_that_solve_it():
    """Not always the first: of the successful d_c, from 0.2 to 0.5, each third is taken about equally often."""
    criticals = [case.expert.critical for case in fresh.draw(SOURCE, SPLIT, 7, ENGINE).cases]
    counts, _ = np.histogram(criticals, bins=[0.2, 0.3, 0.4, 0.5])
    assert counts.min() > 30


def test_equal_seeds_draw_equal_settings_and_other_seeds_do_not():
    first = fresh.draw(SOURCE, SPLIT, 7, ENGINE)
    assert fresh.draw(SOURCE, SPLIT, 7, ENGINE, rows=20).cases == first.cases[:20]
    assert not set(fresh.draw(SOURCE, SPLIT, 8, ENGINE).cases) & set(first.cases)


def test_the_seed_depends_on_the_submission_and_on_the_beacon():
    seeds = {fresh.seed_of(submission, beacon) for submission in "ab" for beacon in "xy"}
    assert len(seeds) == 4
    assert all(0 <= seed < 2**64 for seed in seeds)


@pytest.mark.parametrize("name", ["hard", "open", "train"])
def test_splits_that_no_search_draws_are_refused(name: str):
    with pytest.raises(fresh.NoFreshSettings, match="is not drawn by a search"):
        fresh.draw(SOURCE, Split(name, "brief", CASES, "0" * 64), 0, ENGINE)


@pytest.mark.slow
def test_experts_solve_fresh_settings_of_a_shipped_split():
    source = open_source("synthetic")
    drawn = fresh.draw(source, load_split("synthetic", "test"), 0, Engine(1024, 2), rows=5)
    assert [episode.score for _, episode in rollout(ExpertAgent(), source, drawn.cases)] == [20.0] * 5
