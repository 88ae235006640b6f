"""Results are found by label or path, runs before published results, and a damaged result is named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from msgspec import to_builtins
from msgspec.structs import replace

from dextron_bench.errors import NotFound
from dextron_bench.evaluation.results import Result, scores_by_split
from dextron_bench.runs import result_files
from dextron_bench.storage import records
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.provenance import Provenance
from dextron_bench.storage.run_folder import RunFolder

SPLIT: dict[str, Any] = {"digest": "d", "scores": [1.0], "failed": 0, "causes": {"slipped": 1}, "closing_lag": 0.04}
RESULT: dict[str, Any] = {"method": "a", "reaches": "real", "seed": 0, "splits": {"test": SPLIT}}


def write(runs: Path, method: str, seed: int, score: float = 1.0, reaches: str = "real") -> Path:
    """Writes a result into a folder of runs; returns the file."""
    run = RunFolder.of(runs, method, reaches, seed)
    run.path.mkdir(parents=True)
    content = {"method": method, "reaches": reaches, "seed": seed, "splits": {"test": SPLIT | {"scores": [score]}}}
    run.result.write_text(json.dumps(content))
    return run.result


def described(results: result_files.Results) -> list[tuple[str, str, int, float]]:
    """Method, source, seed and score of each result."""
    return [(r.method, r.reaches, r.seed, r.splits["test"].scores[0]) for r in results]


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of runs with `bc`; among the published results are `bc`, with another score, and `rl`."""
    monkeypatch.setattr(result_files, "published_results", lambda: tmp_path / "published")
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "published", "bc", 0, 20.0)
    write(tmp_path / "published", "rl", 0, 15.0)
    write(tmp_path / "published", "rl", 1, 16.0)
    write(tmp_path / "runs", "bc", 0, 2.0)
    write(tmp_path / "runs", "bc", 1, 3.0)
    write(tmp_path / "runs", "bc", 0, 4.0, "synthetic")
    return tmp_path / "runs"


def test_a_label_finds_the_runs_before_the_published_results(runs: Path):
    expected = [("bc", "real", 0, 2.0), ("bc", "real", 1, 3.0), ("bc", "synthetic", 0, 4.0)]
    assert described(result_files.find("bc", runs)) == expected
    assert described(result_files.find("bc", runs / "none")) == [("bc", "real", 0, 20.0)]


def test_a_label_without_a_run_finds_the_published_results(runs: Path):
    assert described(result_files.find("rl", runs)) == [("rl", "real", 0, 15.0), ("rl", "real", 1, 16.0)]


def test_published_results_stand_in_for_sources_that_were_not_played_here(runs: Path):
    write(runs, "rl", 0, 7.0, "synthetic")
    expected = [("rl", "synthetic", 0, 7.0), ("rl", "real", 0, 15.0), ("rl", "real", 1, 16.0)]
    assert described(result_files.find("rl", runs)) == expected


def test_published_results_stand_in_for_splits_that_were_not_played_here(runs: Path):
    """The published `bc` has `hard` on real reaches; the runs have only `test`."""
    file = runs.parent / "published/bc/real/seed0/result.json"
    content = json.loads(file.read_text())
    file.write_text(json.dumps(content | {"splits": content["splits"] | {"hard": SPLIT}}))
    assert described(result_files.find("bc", runs, "hard"))[-1] == ("bc", "real", 0, 20.0)
    mine = [("bc", "real", 0, 2.0), ("bc", "real", 1, 3.0), ("bc", "synthetic", 0, 4.0)]
    assert described(result_files.find("bc", runs, "test")) == mine


def test_a_run_without_a_result_is_not_found(runs: Path):
    (runs / "rl" / "real" / "seed7").mkdir(parents=True)  # The run is not finished.
    assert len(result_files.find("rl", runs)) == 2


@pytest.mark.parametrize(
    ("path", "scores"),
    [
        ("runs/bc/real/seed1/result.json", [3.0]),
        ("runs/bc/real/seed1", [3.0]),
        ("runs/bc/real", [2.0, 3.0]),
        ("runs/bc", [2.0, 3.0, 4.0]),
        ("published/bc/real/seed0/result.json", [20.0]),
    ],
)
def test_a_path_finds_a_result_a_run_a_source_or_a_method(runs: Path, path: str, scores: list[float]):
    for text in (path, str(runs.parent / path)):
        assert [score for *_, score in described(result_files.find(text, runs))] == scores


def test_an_unknown_name_is_answered_with_the_valid_ones(runs: Path):
    with pytest.raises(NotFound) as caught:
        result_files.find("bcc", runs)
    assert str(caught.value) == (
        f"no result of 'bcc': {runs} has bc, and published results are bc, rl; give one of them, or the path of a run"
    )
    with pytest.raises(NotFound, match=r"has none, and published results are bc, rl"):
        result_files.find("runs/no/where", runs / "none")


def test_a_folder_with_two_methods_is_refused(runs: Path):
    file = write(runs / "mixed", "bc", 0).parent
    file.rename(runs / "mixed" / "seed0")
    write(runs / "other", "rl", 1).parent.rename(runs / "mixed" / "seed1")
    with pytest.raises(NotFound, match=r"mixed' holds results of bc, rl; give one of them"):
        result_files.find(str(runs / "mixed"), runs)


def test_finished_runs_are_those_with_a_result(runs: Path):
    (runs / "bc" / "real" / "seed2").mkdir()
    assert [run.seed for run in result_files.finished(runs, "bc")] == [0, 1, 0]
    assert result_files.finished(runs, "rl") == []


def test_the_scores_of_a_split_are_computed_from_its_rows():
    table = pd.DataFrame(
        {
            "split": ["val", "val", "test"],
            "digest": ["v", "v", "t"],
            "score": [20.0, 0.0, 3.0],
            "failure": ["", "action is nan at step 0", ""],
            "cause": ["solved", "agent failed", "slipped"],
            "closing_lag": [0.1, None, None],
        }
    )
    assert {name: to_builtins(scores) for name, scores in scores_by_split(table).items()} == {
        "val": {
            "digest": "v",
            "scores": [20.0, 0.0],
            "failed": 1,
            "causes": {"solved": 1, "agent failed": 1},
            "closing_lag": 0.1,
        },
        "test": {"digest": "t", "scores": [3.0], "failed": 0, "causes": {"slipped": 1}, "closing_lag": None},
    }


NO_RESULTS = [
    {},
    [],
    RESULT | {"splits": []},
    RESULT | {"splits": {"test": {}}},
    RESULT | {"splits": {"test": SPLIT | {"scores": ["a"]}}},
]


@pytest.mark.parametrize("text", ["", "{", *map(json.dumps, NO_RESULTS)])
def test_a_damaged_result_is_named(tmp_path: Path, text: str):
    file = RunFolder.of(tmp_path, "a", "real", 0).result
    file.parent.mkdir(parents=True)
    file.write_text(json.dumps(RESULT))
    assert list(result_files.results(tmp_path)) == [records.convert(RESULT, Result)]
    file.write_text(text)
    with pytest.raises(DamagedFile, match=r"result\.json is damaged"):
        list(result_files.results(tmp_path))


def test_published_results_of_another_physics_are_not_put_beside(runs: Path):
    """A result that does not name its physics has nothing beside it."""
    file = write(runs.parent / "published", "sor", 0)
    file.write_text(json.dumps(RESULT | {"method": "sor", "provenance": {"physics": "b" * 64}}))
    unknown = records.convert(RESULT, Result)
    known = replace(unknown, provenance=Provenance(physics="b" * 64))
    assert [one.method for one in result_files.published_beside([known])] == ["sor"]
    assert result_files.published_beside([unknown]) == []
