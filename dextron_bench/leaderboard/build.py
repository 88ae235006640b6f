"""The published leaderboard: results, curves and weights taken over from runs, and what is made of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.leaderboard.collect import RESULTS
from dextron_bench.leaderboard.readme import _insert, _picture, _sections
from dextron_bench.runs import result_files
from dextron_bench.scores import standings
from dextron_bench.storage import atomic
from dextron_bench.training.jobs import CURVE

MADE = ("tier", "frames", "demonstrations", "seconds", "hardware", "privileged")
Curves = dict[int, pd.DataFrame]  # By seed; columns epoch, return, success.


def build(into: Path) -> list[Path]:
    """Makes the table (CSV, JSON), its short form in the README, learning curves and the page from the results.

    The page links to recordings in the folder beside. Returns the files; raises DamagedFile, BrokenRecording.
    """
    from dextron_bench.leaderboard import page
    from dextron_bench.leaderboard.highlights import FOLDER
    from dextron_bench.scores import figures

    results = list(result_files.results(into / RESULTS))
    rows = standings.table(results)
    known = _whole(rows, results)
    made = [into / "table.csv", into / "README.md", into / "table.json"]
    atomic.write_atomically(made[0], lambda part: known.to_csv(part, index=False, float_format="%.6g"))
    atomic.write_atomically(made[2], lambda part: known.to_json(part, orient="records", indent=1))
    curves: dict[str, dict[str, Curves]] = defaultdict(dict)
    for (method, reaches), found in learning_curves(into / RESULTS).items():
        curves[reaches][method] = found
    _insert(made[1], "\n".join(_sections(known, set(curves))))
    for reaches, found in curves.items():
        made.append(into / _picture(reaches))
        figures.learning_curves(found, rows[rows["reaches"] == reaches], made[-1])
    made.append(into / page.FILE)
    text = page.document(rows, results, curves, into.resolve().parent / FOLDER)
    atomic.write_atomically(made[-1], lambda part: part.write_text(text, encoding="utf-8"))
    return made


def _whole(rows: pd.DataFrame, results: Iterable[dict[str, Any]]) -> pd.DataFrame:
    """The leaderboard's rows with how far each was checked and what making it took, the columns MADE."""
    from dextron_bench.leaderboard.page import rows as page_rows

    told = [each for each in page_rows.entries(rows, results) if each.tier != page_rows.QUOTED]
    return rows.assign(**{name: [getattr(each, name) for each in told] for name in MADE})


def learning_curves(runs: Path, cloned: bool = False) -> dict[tuple[str, str], Curves]:
    """The learning curves of runs that live in the world, by method and source of reaches; raises DamagedFile.

    What has no frames has no place on their axis: it is `cloned` from demonstrations.
    """
    found: dict[tuple[str, str], Curves] = defaultdict(dict)
    for file in sorted(runs.glob(f"*/*/seed*/{CURVE}")):
        result = result_files.read_result(file.with_name(result_files.RESULT))
        points = pd.DataFrame(atomic.read_json(file)["points"])
        if (result["training"]["frames"] is None) == cloned:
            found[result["method"], result["reaches"]][result["seed"]] = points
    return found
