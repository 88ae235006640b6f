"""Results: wrong values are named with their place, and what is read is written with the same bytes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from dextron_bench.evaluation.results import Result
from dextron_bench.storage import atomic, records
from dextron_bench.storage.atomic import DamagedFile
from tests.helpers.results import SPLIT

ROOT = Path(__file__).parents[2]
RESULT: dict[str, Any] = {"method": "a", "reaches": "real", "seed": 0, "splits": {"test": SPLIT}}
PUBLISHED = sorted((ROOT / "leaderboard" / "results").glob("*/*/*/result.json"))


def test_entries_that_a_result_does_not_name_are_accepted(tmp_path: Path):
    (tmp_path / "result.json").write_text(json.dumps(RESULT | {"new": 1}))
    assert records.read(tmp_path / "result.json", Result) == records.convert(RESULT, Result)


def test_published_results_are_written_as_they_were_read(tmp_path: Path):
    assert PUBLISHED
    for file in PUBLISHED:
        atomic.write_json(tmp_path / "result.json", records.read(file, Result))
        assert (tmp_path / "result.json").read_bytes() == file.read_bytes()


@pytest.mark.parametrize("part", [{"git": None, "dirty": None}, {"machine": {"cpu": "a", "cores": None}}, {}])
def test_unknown_and_missing_parts_of_a_provenance_stay_apart(part: dict[str, Any], tmp_path: Path):
    """A `null` that was written says that something is not known; an earlier version wrote nothing."""
    atomic.write_json(tmp_path / "a.json", RESULT | {"provenance": part})
    atomic.write_json(tmp_path / "b.json", records.read(tmp_path / "a.json", Result))
    assert json.loads((tmp_path / "b.json").read_text())["provenance"] == part


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": None}, "method: Expected `str`, got `null`"),
        ({"seed": True}, "seed: Expected `int`, got `bool`"),
        ({"seed": -1}, "seed: Expected `int` >= 0"),
        ({"seed": 2**53 + 1}, "seed: Expected `int` <= 9007199254740992"),
        ({"seed": 10**30}, "seed: Expected `int` <= 9007199254740992"),
        ({"splits": {}}, "splits: Expected `object` of length >= 1"),
        ({"splits": {"test": SPLIT | {"closing_lag": "soon"}}}, "splits/test/closing_lag: Expected `float | null`"),
        ({"splits": {"test": SPLIT | {"scores": [20.0, 1e308]}}}, "splits/test/scores/1: Expected `float` <= 20.0"),
        ({"splits": {"test": SPLIT | {"scores": [-5]}}}, "splits/test/scores/0: Expected `float` >= 0.0"),
        ({"splits": {"test": SPLIT | {"scores": []}}}, "splits/test/scores: Expected `array` of length >= 1"),
        ({"splits": {"test": SPLIT | {"scores": [math.nan]}}}, "NaN is no JSON number"),
        ({"splits": {"test": SPLIT | {"scores": [10**400]}}}, "splits/test/scores/0: Number out of range"),
        ({"training": {"frames": "many"}}, "training/frames: Expected `int | float | null`"),
    ],
)
def test_a_wrong_value_is_named_with_its_place(tmp_path: Path, change: dict[str, Any], message: str):
    file = tmp_path / "result.json"
    file.write_text(json.dumps(RESULT | change))
    with pytest.raises(DamagedFile) as caught:
        records.read(file, Result)
    text, is_proof = str(caught.value), "NaN" in message
    assert text.startswith(f"{file} is damaged {'' if is_proof else 'or of another version '}(")
    assert message in text
    assert ("remove" in text) == is_proof
