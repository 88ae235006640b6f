"""Rows keep their conditions, and the package plays nothing else."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import dextron_bench
from dextron_bench.errors import NotFound
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches.setting import Setting
from dextron_bench.splits.loading import Split
from dextron_bench.splits.rows import Rows
from dextron_bench.splits.tracks import TRACKS
from dextron_bench.world.bottle import Bottle

PACKAGE = Path(dextron_bench.__file__).parent
CASES = tuple(Case(Setting(name, 0.0, 0.0, 0.0), Expert(1.0, 0.1), 0.1) for name in "abc")
BOTTLES = tuple(Bottle(mass, 1.0, 0.025) for mass in (0.3, 0.6, 0.9))
SPLIT = Split(name="test+x", reaches="synthetic", digest="0", cases=CASES, track=TRACKS["delay-40"], bottles=BOTTLES)
READERS = {"enumerate", "zip", "tuple", "list"}  # Functions that may receive cases: they play nothing.
MAY_TAKE_APART = {  # Files that may hand on cases alone, and why.
    "splits/": "they make and compare splits",
    "evaluation/rollout.py": "it plays them",
    "evaluation/replay.py": "it drops the track: stored actions are those that arrived",
    "training/jobs.py": "a learner receives the cases of `train`, which has no conditions",
    "training/loop.py": "it hashes what a learner received",
}


def test_rows_keep_their_order_their_track_and_their_bottles():
    rows = SPLIT.rows([2, 0])
    assert rows == Rows(cases=(CASES[2], CASES[0]), track=TRACKS["delay-40"], bottles=(BOTTLES[2], BOTTLES[0]))
    assert SPLIT.first(2) == SPLIT.rows([0, 1])
    assert len(SPLIT.first(9)) == 3
    assert Rows(cases=CASES).rows([1]) == Rows(cases=(CASES[1],))


def test_a_row_that_does_not_exist_is_refused():
    with pytest.raises(NotFound, match=r"test\+x of synthetic reaches has rows 0 to 2, not 3"):
        SPLIT.rows([3])
    with pytest.raises(NotFound):
        SPLIT.rows([-1])
    with pytest.raises(ValueError, match="3 cases cannot have 1 bottles"):
        Rows(cases=CASES, bottles=BOTTLES[:1])


def taken_apart(code: str) -> Iterator[int]:
    """Lines that use `.cases` for anything but a loop over them, or one of READERS."""
    tree = ast.parse(code)
    parents = {child: parent for parent in ast.walk(tree) for child in ast.iter_child_nodes(parent)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr == "cases":
            parent, child = parents[node], node
            if isinstance(parent, ast.Starred) and isinstance(parents[parent], ast.Tuple):
                parent, child = parents[parents[parents[parent]]], parents[parents[parent]]
            is_loop = isinstance(parent, ast.For | ast.comprehension) and parent.iter is child
            is_read = isinstance(parent, ast.Call) and getattr(parent.func, "id", "") in {*READERS, "Rows"}
            if not (is_loop or is_read):
                yield node.lineno


@pytest.mark.parametrize(
    ("code", "lines"),
    [
        ("[case.setting for case in split.cases]", []),
        ("for row, case in enumerate(split.cases): pass", []),
        ("Rows(cases=(*rows.cases, *drawn), track=rows.track)", []),
        ("rollout(agent, source, split.cases)", [1]),
        ("rollout(agent, source, split.cases[:5])", [1]),
        ("cases = split.cases", [1]),
        ("rollout(agent, source, [*split.cases])", [1]),
    ],
)
def test_what_takes_a_split_apart_is_found(code: str, lines: list[int]):
    assert list(taken_apart(code)) == lines


@pytest.mark.slow
def test_nothing_hands_on_the_cases_of_a_split_without_their_conditions():
    faults = [
        f"{place}:{line}"
        for file in sorted(PACKAGE.rglob("*.py"))
        if not (place := str(file.relative_to(PACKAGE))).startswith(tuple(MAY_TAKE_APART))
        for line in taken_apart(file.read_text(encoding="utf-8"))
    ]
    assert faults == []
