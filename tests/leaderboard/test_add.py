"""Additions to the board: names that resemble another row's are refused, and the board changes in one step."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from dextron_bench.errors import BadInput
from dextron_bench.leaderboard import add, board_rows, build, verify_board
from dextron_bench.recording import read_safely
from dextron_bench.world import task
from tests.helpers import tiny_benchmark
from tests.helpers.forged_bundles import Forgery


@pytest.mark.parametrize(
    "name",
    ["exp", "Exp", "rlil-0.3", "RLIL-0.1-mine", "exp\n", "first", "FIRST", "rlil_0.1", "exp.", "F1RST", "f-irst"],
)
def test_names_that_equal_or_resemble_another_are_refused(name: str, tmp_path: Path):
    (tmp_path / "results" / "first" / "real" / "seed0").mkdir(parents=True)
    with pytest.raises(BadInput):
        add.check_name(name, "synthetic", tmp_path, replace=True)
    add.check_name("first-of-mine", "synthetic", tmp_path, replace=False)


@pytest.mark.slow
def test_the_board_changes_in_one_step_and_nothing_else_is_left(
    forged: Forgery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The copy that is built lies beside the board, since a rename works on one disk only."""
    verdict, board, temporary = forged.checked(), tmp_path / "board", tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    (tmp_path / ".board.part/results/near/synthetic/seed7").mkdir(parents=True)  # From an addition that was killed.
    built = add.merge(verdict, board, tmp_path / "none")
    assert {file.name for file in built} >= {"table.csv", "README.md", "index.html"}
    assert all(file.is_file() for file in built)
    seeds = sorted(path.name for path in (board / "results/near/synthetic").iterdir())
    assert seeds == ["bundle.json", "seed0"]
    before = {file: file.read_bytes() for file in board.rglob("*") if file.is_file()}

    def build_and_fail(part: Path) -> list[Path]:
        real_build(part)
        assert {file: file.read_bytes() for file in board.rglob("*") if file.is_file()} == before
        raise KeyboardInterrupt

    real_build = build.build
    monkeypatch.setattr(build, "build", build_and_fail)
    with pytest.raises(KeyboardInterrupt):
        add.merge(verdict, board, tmp_path / "none")
    assert {file: file.read_bytes() for file in board.rglob("*") if file.is_file()} == before
    assert not list(temporary.iterdir())
    assert not list(tmp_path.glob(".board*"))


@pytest.mark.slow
def test_the_board_keeps_the_code_of_a_submission_and_records_a_success_and_a_failure(forged: Forgery, tmp_path: Path):
    """The agent solves a row and fails another one; the page links to both recordings and to its code."""
    board = tmp_path / "board"
    stale = tmp_path / "recordings/near-failure.rrd"
    stale.parent.mkdir()
    stale.write_text("of an older submission")
    add.merge(forged.checked(), board, forged.folder / "agent")
    place = board / "results/near" / tiny_benchmark.NAME
    assert (place / "agent/near.py").read_bytes() == (forged.folder / "agent/near.py").read_bytes()
    recordings = {file.name: read_safely(file) for file in (tmp_path / "recordings").iterdir()}
    returns = {name: recorded.episode.score for name, recorded in recordings.items()}
    assert returns.keys() == {"near-success.rrd", "near-failure.rrd"}
    assert returns["near-failure.rrd"] < returns["near-success.rrd"] == task.SUCCESS
    assert {recorded.properties["method"] for recorded in recordings.values()} == {"near"}
    assert not list(place.glob("seed*/recordings*"))
    page = (board / "index.html").read_text()
    assert f'href="results/near/{tiny_benchmark.NAME}/agent/near.py"' in page
    assert page.count('href="../recordings/near-success.rrd"') >= 1
    (place / "agent/near.py").write_text("print()")
    (row,) = board_rows.rows(board)
    assert verify_board.check(row, board, threads=1).problems == ["its manifest lists another agent/near.py"]
