"""Writes the leaderboard's tables as Markdown into its README."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pandas as pd

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.scores import cells
from dextron_bench.splits.names import SPLIT_NAMES
from dextron_bench.storage import atomic
from dextron_bench.storage.printable import printable
from dextron_bench.world import model

BEGIN, END = "<!-- made by `dextron-bench leaderboard build`: -->", "<!-- end of what was made -->"


def insert(file: Path, text: str) -> None:
    """Replaces the text between the two marks of a file; creates the file if it does not exist."""
    old = file.read_text(encoding="utf-8") if file.exists() else f"# Leaderboard\n\n{BEGIN}\n{END}\n"
    before, _, rest = old.partition(BEGIN)
    after = rest.partition(END)[2] or "\n"
    new = f"{before.rstrip()}\n\n{BEGIN}\n{text}\n{END}{after}"
    atomic.write_atomically(file, lambda part: part.write_text(new, encoding="utf-8"))


def picture(reaches: str) -> str:
    """Name of the picture with the learning curves of a source of reaches."""
    return f"curves-{reaches}.png"


def sections(rows: pd.DataFrame, with_curves: set[str]) -> Iterator[str]:
    """The README's lines for each source of reaches: a table of scores, the learning curves, a table of endings.

    Methods are in the order of their return on `test`, and ranks are the ranks on `test`. Only the sources in
    `with_curves` have a picture of learning curves.
    """
    yield f"\nAll episodes were played with physics `{model.mjcf_hash()[:8]}`."
    for source, group in rows.groupby("reaches", sort=False):
        yield from _scores(str(source), group)
        if source in with_curves:
            yield f"\n![Learning curves on {source} reaches]({picture(str(source))})"
        yield from _endings(group[group["split"] == "test"])


def _scores(source: str, rows: pd.DataFrame) -> Iterator[str]:
    """Returns and successes on every split, a line for each method."""
    splits = [name for name in SPLIT_NAMES if name in set(rows["split"])]
    fresh = "; mean return on [fresh settings](../docs/leaderboard.md#fresh-settings)"
    also = fresh if rows["fresh"].notna().any() else ""
    yield f"\n## {source} reaches\nMean return of 20 with its 95 % interval, and successes [%]{also}.\n"
    yield _line(["rank", "method", "seeds", "tier", *(f"`{name}`" for name in splits)])
    yield _line(["---"] * (4 + len(splits)))
    for method in rows[rows["split"] == "test"]["method"]:
        by_split = {row["split"]: row for row in rows[rows["method"] == method].to_dict("records")}
        first = next(iter(by_split.values()))
        scores = (_score(by_split[name]) if name in by_split else "" for name in splits)
        yield _line([cells.rank(by_split["test"]), f"`{method}`", first["seeds"], first["tier"], *scores])


def _endings(rows: pd.DataFrame) -> Iterator[str]:
    """How episodes end, a line for each method."""
    yield "\nHow episodes of `test` end [%] ([docs/diagnosis.md](../docs/diagnosis.md)); closing lag in seconds.\n"
    yield _line(["method", *CAUSES, "closing lag"])
    yield _line(["---", *["---:"] * (len(CAUSES) + 1)])
    for row in rows.to_dict("records"):
        yield _line([f"`{row['method']}`", *cells.cause_shares(row), cells.closing_lag(row)])


def _score(row: cells.Row) -> str:
    fresh = ", ".join(filter(None, (cells.fresh(row).value, cells.mark(row))))
    return f"{cells.mean_return(row)}, {cells.success(row).value} %" + (f"; fresh {fresh}" if fresh else "")


def _line(values: Iterable[object]) -> str:
    return "| " + " | ".join(printable(str(value)).replace("|", "\\|") for value in values) + " |"
