"""Writes the leaderboard's tables as Markdown into its README."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import pandas as pd

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.scores import cells
from dextron_bench.splits.names import EVALUATED, SPLIT_NAMES
from dextron_bench.storage import atomic
from dextron_bench.storage.printable import printable
from dextron_bench.world import model

NO_ROUND = "No round has been played yet, so no method has a rank."
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


def sections(rows: pd.DataFrame, ranked: pd.DataFrame, with_curves: set[str]) -> Iterator[str]:
    """The README's lines for each source: ranks, scores on public splits, the learning curves, a table of endings.

    `ranked` is the table of the latest round. Only the sources in `with_curves` have a picture of learning curves.
    """
    yield f"\nAll episodes were played with physics `{model.mjcf_hash()[:8]}`."
    for source, group in rows.groupby("reaches", sort=False):
        yield f"\n## {source} reaches"
        yield from _ranks(ranked[ranked["reaches"] == source])
        yield from _scores(group)
        if source in with_curves:
            yield f"\n![Learning curves on {source} reaches]({picture(str(source))})"
        yield from _endings(group[group["split"] == "test"])


def _ranks(ranked: pd.DataFrame) -> Iterator[str]:
    """The ranks of a source, a line for each method."""
    if ranked.empty:
        yield f"\n{NO_ROUND}"
        return
    splits = [name for name in EVALUATED if ranked[name].notna().any()]
    number, margin = ranked["round"].iloc[0], 100 * ranked["margin"].iloc[0]
    yield (
        f"\nRound {number}: settings that nobody could know ([docs/leaderboard.md](../docs/leaderboard.md#rounds)), "
        f"successes [%]; the margin of ranks is {margin:.1f} points.\n"
    )
    yield _line(["rank", "method", "score", *(f"`{name}`" for name in splits), "seeds"])
    yield _line(["---"] * (4 + len(splits)))
    for row in ranked.to_dict("records"):
        shares = (cells.share(row, name) for name in splits)
        yield _line([cells.rank(row) or row["unranked"], f"`{row['method']}`", cells.score(row), *shares, row["seeds"]])


def _scores(rows: pd.DataFrame) -> Iterator[str]:
    """Returns and successes on every public split, a line for each method, in the order of their return on `test`."""
    splits = [name for name in SPLIT_NAMES if name in set(rows["split"])]
    yield "\nPublic splits (`test` is the paper's protocol): mean return of 20 with its 95 % interval, successes.\n"
    yield _line(["method", "seeds", "tier", *(f"`{name}`" for name in splits)])
    yield _line(["---"] * (3 + len(splits)))
    for method in rows[rows["split"] == "test"]["method"]:
        by_split = {row["split"]: row for row in rows[rows["method"] == method].to_dict("records")}
        first = next(iter(by_split.values()))
        scores = (_score(by_split[name]) if name in by_split else "" for name in splits)
        yield _line([f"`{method}`", first["seeds"], first["tier"], *scores])


def _endings(rows: pd.DataFrame) -> Iterator[str]:
    """How episodes end, a line for each method."""
    yield "\nHow episodes of `test` end [%] ([docs/diagnosis.md](../docs/diagnosis.md)); closing lag in seconds.\n"
    yield _line(["method", *CAUSES, "closing lag"])
    yield _line(["---", *["---:"] * (len(CAUSES) + 1)])
    for row in rows.to_dict("records"):
        yield _line([f"`{row['method']}`", *cells.cause_shares(row), cells.closing_lag(row)])


def _score(row: cells.Row) -> str:
    return f"{cells.mean_return(row)}, {cells.success(row).value} %"


def _line(values: Iterable[object]) -> str:
    return "| " + " | ".join(printable(str(value)).replace("|", "\\|") for value in values) + " |"
