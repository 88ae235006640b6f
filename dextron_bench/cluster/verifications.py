"""The verification of a board on a cluster: a task checks one row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dextron_bench.cluster.evaluations import check_expected
from dextron_bench.cluster.inputs import imported_reaches
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import RUNS, Task
from dextron_bench.leaderboard import collect, fresh_baselines, verify_board
from dextron_bench.leaderboard.finding_pieces import FindingPieces
from dextron_bench.leaderboard.verify_board import Row
from dextron_bench.runs import result_files
from dextron_bench.storage.folders import visible
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder

BOARD, FOLDER = "board", "verify"  # Below a node's folder of runs.
NOT_NEEDED = (".rrd",)


def check(
    cluster: RayCluster, pieces: FindingPieces, rows: Sequence[Row], runs: Path, progress: Progress = no_progress
) -> None:
    """Checks the rows of a board whose findings the folder lacks; `progress` receives rows.

    Raises the errors of `FindingPieces.read` and of `RayCluster.run`.
    """
    stored = pieces.read(rows)
    left = [row for row in rows if row.run.identity not in stored]
    cluster.run_all([_task(pieces, row, runs, cluster.threads) for row in left], progress)


def _task(pieces: FindingPieces, row: Row, runs: Path, threads: int) -> Task:
    reaches, board = row.result.reaches, pieces.board
    files = [file for file in visible(row.run.path.parent, "**/*") if file.suffix not in NOT_NEEDED]
    files += visible(board / fresh_baselines.FOLDER, f"{reaches}.*")
    inputs = {f"{RUNS}/{BOARD}/{file.relative_to(board).as_posix()}": file for file in files if file.is_file()}
    arguments = {
        "identity": row.run.identity,
        "folder": pieces.folder.relative_to(runs).as_posix(),
        "flags": pieces.flags,
        "expected": pieces.config_of(row),
    }
    return Task(row.run.identity, check_row, arguments, inputs | imported_reaches(reaches), threads)


def check_row(
    runs: Path, threads: int, identity: str, folder: str, flags: dict[str, Any], expected: Mapping[str, Any]
) -> Sequence[Path]:
    """Checks a row of the board; returns the files of its finding. Raises OtherVersion if it is not as expected."""
    board = runs / BOARD
    run = RunFolder(board / collect.RESULTS / identity)
    row, pieces = Row(run, result_files.read_result(run.result)), FindingPieces(runs / folder, board, flags)
    check_expected(identity, pieces.config_of(row), expected)
    return pieces.write(row, verify_board.check(row, board, flags["rows"], flags["redraw"], threads))
