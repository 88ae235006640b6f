"""Builds the leaderboard from its results: tables, Markdown, learning curves and the page."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.results import Result
from dextron_bench.leaderboard import readme, round_table
from dextron_bench.leaderboard.collect import RESULTS
from dextron_bench.runs import result_files
from dextron_bench.scores import standings
from dextron_bench.storage import atomic
from dextron_bench.storage.folders import visible
from dextron_bench.storage.printable import spreadsheet_cell
from dextron_bench.storage.run_folder import run_folders
from dextron_bench.submissions.bundle import AGENT
from dextron_bench.training import learning_curve
from dextron_bench.world import model

ORIGIN = ("tier", "frames", "demonstrations", "seconds", "hardware", "privileged")
IN_TABLE = ("method", "reaches", "rank", "unranked", *round_table.SCORES, "round", "margin")
Curves = dict[int, pd.DataFrame]  # By seed; columns epoch, return, success.


def build(board: Path) -> list[Path]:
    """Writes table (CSV, JSON), README tables, pictures of learning curves and page into a leaderboard's folder.

    The page links to the recordings in the folder beside the leaderboard's. Returns the files; raises BadInput,
    DamagedFile, BrokenRecording.
    """
    from dextron_bench.leaderboard import page
    from dextron_bench.leaderboard.highlights import FOLDER
    from dextron_bench.scores.figures import training

    results = _results_of_this_world(board / RESULTS)
    rows, ranked = standings.table(results), round_table.table(board)
    table = _with_origin(rows, results).merge(ranked[[*IN_TABLE]], on=["method", "reaches"], how="left")
    files = [board / "table.csv", board / "README.md", board / "table.json"]
    spreadsheet = table.map(lambda value: spreadsheet_cell(value) if isinstance(value, str) else value)
    atomic.write_atomically(files[0], lambda part: spreadsheet.to_csv(part, index=False, float_format="%.6g"))
    atomic.write_atomically(files[2], lambda part: table.to_json(part, orient="records", indent=1))
    curves = _curves_by_source(board / RESULTS)
    readme.insert(files[1], "\n".join(readme.sections(table, ranked, set(curves))))
    for reaches, by_method in curves.items():
        files.append(board / readme.picture(reaches))
        training.learning_curves(by_method, rows[rows["reaches"] == reaches], files[-1])
    files.append(board / page.FILE)
    text = page.document(rows, ranked, results, curves, board.resolve().parent / FOLDER, _code_of_submissions(board))
    atomic.write_atomically(files[-1], lambda part: part.write_text(text, encoding="utf-8"))
    return files


def _results_of_this_world(runs: Path) -> list[Result]:
    """The results below a folder; raises BadInput if one was played with other physics than this version's."""
    results = list(result_files.results(runs))
    for result in results:
        if result.physics != model.mjcf_hash():
            raise BadInput(
                f"{result.method} on {result.reaches} reaches, seed {result.seed}, was played with physics "
                f"{result.physics[:8] or 'unknown'}, and this version has {model.mjcf_hash()[:8]}; remove it from "
                f"{runs}, and run it again"
            )
    return results


def _with_origin(rows: pd.DataFrame, results: Iterable[Result]) -> pd.DataFrame:
    """The leaderboard's rows with the columns ORIGIN: how far each row was checked, and what its training took."""
    from dextron_bench.leaderboard.page.rows import QUOTED, entries

    ranked_entries = [entry for entry in entries(rows, results) if entry.tier != QUOTED]
    return rows.assign(**{name: [getattr(entry, name) for entry in ranked_entries] for name in ORIGIN})


def _code_of_submissions(board: Path) -> dict[tuple[str, str], list[str]]:
    """The paths from a leaderboard's folder to the files of its agents, by method and source of reaches."""
    code: dict[tuple[str, str], list[str]] = defaultdict(list)
    for file in visible(board, f"{RESULTS}/*/*/{AGENT}/*"):
        code[file.parts[-4], file.parts[-3]].append(file.relative_to(board).as_posix())
    return code


def _curves_by_source(runs: Path) -> dict[str, dict[str, Curves]]:
    """The learning curves of runs, by source of reaches and then by method."""
    curves: dict[str, dict[str, Curves]] = defaultdict(dict)
    for (method, reaches), by_seed in learning_curves(runs).items():
        curves[reaches][method] = by_seed
    return curves


def learning_curves(runs: Path, cloned: bool = False) -> dict[tuple[str, str], Curves]:
    """The learning curves of runs that trained in the world, by method and source of reaches; raises DamagedFile.

    With `cloned`, the curves of methods that learn from demonstrations alone: they have no frames.
    """
    curves: dict[tuple[str, str], Curves] = defaultdict(dict)
    for run in run_folders(runs):
        if not run.curve.exists():
            continue
        result = result_files.read_result(run.result)
        points = learning_curve.frame(learning_curve.read(run.curve))
        if (result.training is not None and result.training.is_in_the_world) != cloned:
            curves[result.method, result.reaches][result.seed] = points
    return curves
