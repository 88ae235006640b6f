"""The catalogue of runs: scores, states, filters and orders."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.catalogue import run_catalogue, run_search
from dextron_bench.catalogue.expressions import BadExpression
from dextron_bench.catalogue.run_catalogue import Entry
from dextron_bench.catalogue.run_search import BadSearch, RunFilter
from dextron_bench.runs import annotations
from dextron_bench.storage.run_folder import RunFolder

SPLIT = {"digest": "d", "failed": 0, "causes": {}, "closing_lag": None}


def write_run(runs: Path, label: str, seed: int, scores: list[float] | None, **settings: object) -> RunFolder:
    """A run folder with a config, and with a result on `test` if there are scores."""
    run = RunFolder.of(runs, label, "real", seed)
    run.path.mkdir(parents=True)
    config = {"method": "mine", "reaches": "real", "seed": seed, "settings": settings, "physics": "p"}
    run.config.write_text(json.dumps(config))
    if scores is not None:
        result = {"method": label, "reaches": "real", "seed": seed, "splits": {"test": SPLIT | {"scores": scores}}}
        run.result.write_text(json.dumps(result))
    return run


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """Two seeds of `mine`, one of them not finished; `mine-near0.06`, which failed; `learner` with a curve."""
    write_run(tmp_path, "mine", 0, [20.0, 10.0], near=0.08)
    write_run(tmp_path, "mine", 1, None, near=0.08)
    failed = write_run(tmp_path, "mine-near0.06", 0, [20.0, 20.0], near=0.06)
    with pytest.raises(ZeroDivisionError), annotations.noting_failure([failed]):
        _ = 1 / 0
    learner = write_run(tmp_path, "learner", 0, [0.0, 4.0])
    points = [{"epoch": 10, "return": 3.0, "success": 0.1}, {"epoch": 20, "return": 2.0, "success": 0.2}]
    learner.curve.write_text(json.dumps({"split": "val", "points": points}))
    return tmp_path


def ended(run: Path, moment: str) -> None:
    (run / "times.json").write_text(json.dumps({"began": "2026-01-01T00:00:00+00:00", "ended": moment}))


def names(entries: list[Entry]) -> list[str]:
    return [entry.label for entry in entries]


def test_an_entry_has_all_seeds_their_scores_and_their_state(runs: Path):
    learner, mine, near = run_catalogue.entries(runs)
    assert (mine.name, mine.seeds, mine.state) == ("mine/real", (0, 1), "unfinished")
    np.testing.assert_array_equal(mine.scores["test"], [[20.0, 10.0]])
    assert (mine.score("test"), mine.score("test", "success")) == (15.0, 0.5)
    assert np.isnan(mine.score("val"))
    assert near.state == "failed: ZeroDivisionError: division by zero"
    assert (learner.state, learner.score("val"), learner.score("val", "success")) == ("done", 3.0, 0.1)


def test_a_success_after_a_failure_removes_it(runs: Path):
    with annotations.noting_failure([RunFolder.of(runs, "mine-near0.06", "real", 0)]):
        pass
    assert run_catalogue.find(run_catalogue.entries(runs), "mine-near0.06").state == "done"


def test_an_interrupted_run_did_not_fail(runs: Path):
    with pytest.raises(KeyboardInterrupt), annotations.noting_failure([RunFolder.of(runs, "mine", "real", 1)]):
        raise KeyboardInterrupt
    assert run_catalogue.find(run_catalogue.entries(runs), "mine").state == "unfinished"


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ({}, ["learner", "mine", "mine-near0.06"]),
        ({"method": "mine*"}, ["mine", "mine-near0.06"]),
        ({"setting": ("near=6e-2",)}, ["mine-near0.06"]),
        ({"setting": ("near=fast",)}, []),
        ({"state": "failed"}, ["mine-near0.06"]),
        ({"reaches": "synthetic"}, []),
        ({"tag": ("good",)}, ["mine"]),
        ({"tag": ("good", "bad")}, []),
        ({"since": "2026-03-01"}, ["learner", "mine"]),
        ({"where": "near < 0.07"}, ["mine-near0.06"]),  # `learner` has no such setting.
        ({"where": "return > 10 and 'good' in tags"}, ["mine"]),
        ({"where": "state == 'done' and val == 3", "method": "l*"}, ["learner"]),
        ({"where": "date < '2026-03-01'"}, ["mine-near0.06"]),
    ],
)
def test_filters(runs: Path, chosen: dict, expected: list[str]):
    annotations.write(runs / "mine/real", annotations.Notes(("good",), "a note"))
    ended(runs / "mine-near0.06/real/seed0", "2026-02-28T23:59:59+00:00")
    ended(runs / "mine/real/seed1", "2026-03-01T00:00:00+00:00")
    ended(runs / "learner/real/seed0", "2026-11-01T00:00:00+00:00")
    assert names(run_search.matching(run_catalogue.entries(runs), RunFilter(**chosen), "test")) == expected


@pytest.mark.parametrize(
    ("order", "split", "expected"),
    [
        ("name", "test", ["learner", "mine", "mine-near0.06"]),
        ("return", "test", ["mine-near0.06", "mine", "learner"]),
        ("return", "val", ["learner", "mine", "mine-near0.06"]),
        ("val", "test", ["learner", "mine", "mine-near0.06"]),
        ("date", "test", ["mine-near0.06", "learner", "mine"]),
    ],
)
def test_orders(runs: Path, order: str, split: str, expected: list[str]):
    for hour, label in enumerate(["mine", "learner", "mine-near0.06"]):
        ended(runs / label / "real" / "seed0", f"2026-03-01T0{hour}:00:00+00:00")
    assert names(run_search.ordered(run_catalogue.entries(runs), order, split)) == expected


def test_defaults_count_as_settings(runs: Path):
    run = write_run(runs, "plain-lead0.03", 0, [20.0], lead=0.03)
    run.config.write_text(json.dumps(json.loads(run.config.read_text()) | {"defaults": {"near": 0.08, "lead": 0.06}}))
    plain = run_catalogue.find(run_catalogue.entries(runs), "plain-lead0.03")
    assert plain.settings == {"near": 0.08, "lead": 0.03}
    assert RunFilter(setting=("near=0.08",)).passes(plain)


def test_settings_that_differ(runs: Path):
    _, mine, near = run_catalogue.entries(runs)
    assert run_search.differing_settings([mine, near]) == ["near"]
    assert run_search.differing_settings([mine, mine]) == []


@pytest.mark.parametrize("wrong", [{"since": "yesterday"}, {"setting": ("near",)}])
def test_impossible_filters_are_refused(wrong: dict):
    with pytest.raises(BadSearch):
        RunFilter(**wrong)


def test_an_unknown_column_of_runs_is_answered_with_the_columns(runs: Path):
    with pytest.raises(BadExpression, match=r"there is no column 'nea'; did you mean near\? columns are name, reaches"):
        run_search.matching(run_catalogue.entries(runs), RunFilter(where="nea == 1"), "test")


@pytest.mark.parametrize(
    ("values", "expected"),
    [([True, False], [True, False]), ([1, None, 2.5], [1.0, np.nan, 2.5]), ([None, (2, 3)], ["", "(2, 3)"])],
)
def test_settings_of_runs_are_of_one_kind(values: list, expected: list):
    np.testing.assert_array_equal(run_search._of_one_kind(values), expected)


def test_a_name_that_no_run_or_several_have_is_refused(runs: Path):
    write = RunFolder.of(runs, "mine", "synthetic", 0)
    write.path.mkdir(parents=True)
    write.config.write_text("{}")
    entries = run_catalogue.entries(runs)
    assert run_catalogue.find(entries, "mine/synthetic").reaches == "synthetic"
    with pytest.raises(
        run_catalogue.UnknownRun, match="several runs are called 'mine'; choose mine/real or mine/synth"
    ):
        run_catalogue.find(entries, "mine")
    with pytest.raises(run_catalogue.UnknownRun, match="no run is called 'yours'; the folder has learner/real, "):
        run_catalogue.find(entries, "yours")


@pytest.mark.parametrize("notes", [{"tags": ("a b",)}, {"tags": ("",)}, {"note": "x" * 2001}])
def test_bad_notes_are_refused(notes: dict):
    with pytest.raises(annotations.BadNote):
        annotations.Notes(**notes)
