"""Records: wrong values are named with their place, and what is read is written with the same bytes."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest
from msgspec import field

from dextron_bench.storage import atomic, records, tensors
from dextron_bench.storage.records import Amount, Count, Record, Scores
from dextron_bench.training import learning_curve
from dextron_bench.world import task

ROOT = Path(__file__).parents[2]


class Part(Record, frozen=True):
    scores: Scores
    counts: dict[str, Count] = field(default_factory=dict)


class Whole(Record, frozen=True):
    name: str
    parts: dict[str, Part] = field(default_factory=dict)
    more: tuple[Part, ...] = ()
    seconds: Amount | None = None


CONTENT: dict[str, Any] = {"name": "a", "parts": {"x": {"scores": [1.0]}, "y": {"scores": [2.5]}}, "seconds": 3}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": None}, "name: Expected `str`, got `null`"),
        ({"seconds": True}, "seconds: Expected `int | float | null`, got `bool`"),
        ({"seconds": -1}, "seconds: Expected `int` >= 0"),
        ({"parts": {"x": {"scores": [1.0]}, "y": {"scores": []}}}, "parts/y/scores: Expected `array` of length >= 1"),
        ({"parts": {"x": {"scores": [1.0], "counts": {"a": 1, "b": 1.5}}}}, "parts/x/counts/b: Expected `int`"),
        ({"more": [{"scores": [0.0]}, {"scores": [0.0, 21.0]}]}, "more/1/scores/1: Expected `float` <= 20.0"),
        ({"more": [{}]}, "more/0: Object missing required field `scores`"),
        ({"parts": {"x": {"scores": [1.0]}, "y": {"scores": [1.0], "counts": []}}, "more": 1}, "parts/y/counts: Exp"),
        ({"parts": []}, "parts: Expected `object`, got `array`"),
    ],
)
def test_a_fault_is_named_with_its_place_and_the_remedy(tmp_path: Path, change: dict[str, Any], message: str):
    file = tmp_path / "a.json"
    file.write_text(json.dumps(CONTENT | change))
    with pytest.raises(atomic.OtherForm) as caught:
        records.read(file, Whole)
    assert str(caught.value).startswith(f"{file} is damaged or of another version ({message}")
    assert str(caught.value).endswith("restore it, or use the version that wrote it")


def test_a_fault_of_the_whole_has_no_place():
    with pytest.raises(records.Mismatch, match=r"^Expected `object`, got `null`$"):
        records.convert(None, Whole)


def test_a_fault_leaves_the_content_as_it_was():
    content = {"name": "a", "parts": {"x": {"scores": [1.0]}, "y": {"scores": [50.0]}, "z": {"scores": [1.0]}}}
    text = json.dumps(content)
    with pytest.raises(records.Mismatch, match="parts/y/scores/0"):
        records.convert(content, Whole)
    assert json.dumps(content) == text


def test_what_is_read_is_written_with_the_same_bytes(tmp_path: Path):
    atomic.write_json(tmp_path / "a.json", CONTENT)
    atomic.write_json(tmp_path / "b.json", records.read(tmp_path / "a.json", Whole))
    assert (tmp_path / "b.json").read_bytes() == (tmp_path / "a.json").read_bytes()


def test_records_are_written_inside_other_values(tmp_path: Path):
    atomic.write_json(tmp_path / "a.json", {"parts": [Part([1.0])]})
    assert json.loads((tmp_path / "a.json").read_text()) == {"parts": [{"scores": [1.0]}]}


def test_entries_without_a_field_may_hold_anything(tmp_path: Path):
    atomic.write_json(tmp_path / "a.json", CONTENT | {"new": {"a": [None]}})
    assert records.read(tmp_path / "a.json", Whole).name == "a"


def test_lines_that_are_cut_or_not_text_are_none():
    lines = b'{"scores": [2.0]}\n\xff\xfe\n[]\n{"scores": ["2"]}\n{"scores": ['
    assert list(records.rows(lines, Part)) == [Part([2.0]), None, None, None, None]


def test_metadata_of_tensors_is_a_record(tmp_path: Path):
    tensors.write(tmp_path / "a.safetensors", {}, {"scores": "3"})
    with pytest.raises(tensors.OtherTensors, match=r"a\.safetensors .*scores: Expected `array`, got `str`"):
        records.read_about(tmp_path / "a.safetensors", Part)


def test_the_full_return_is_the_task_s():
    assert records.FULL_RETURN == task.SUCCESS


@pytest.mark.parametrize("content", [None, "text", [], {}, {"points": None}, {"points": [{"epoch": 1}]}])
def test_a_curve_without_points_is_damaged(tmp_path: Path, content: Any):
    (tmp_path / "curve.json").write_text(json.dumps(content))
    with pytest.raises(atomic.DamagedFile, match=r"curve\.json is damaged"):
        learning_curve.read(tmp_path / "curve.json")


def test_a_number_that_overflows_is_not_finite(tmp_path: Path):
    (tmp_path / "a.json").write_text('{"points": [{"epoch": 1, "return": 1e999, "success": 0.0}]}')
    with pytest.raises(atomic.DamagedFile, match=r"points/0/return: Expected `float` <= 20\.0"):
        learning_curve.read(tmp_path / "a.json")


@pytest.mark.slow
def test_a_json_file_is_read_as_a_record():
    """Bundles have their own reader, since they come from strangers."""
    readers = [
        file.relative_to(ROOT).as_posix()
        for folder in ("dextron_bench", "baselines")
        for file in sorted((ROOT / folder).rglob("*.py"))
        if any(isinstance(node, ast.Attribute) and node.attr == "read_json" for node in ast.walk(_tree(file)))
    ]
    assert readers == ["dextron_bench/storage/records.py"]


def _tree(file: Path) -> ast.AST:
    return ast.parse(file.read_text(encoding="utf-8"))
