"""The leaderboard's tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.splits.loading import SPLIT_NAMES
from dextron_bench.storage import atomic

BEGIN, END = "<!-- made by `dextron-bench leaderboard build`: -->", "<!-- end of what was made -->"


def _insert(file: Path, text: str) -> None:
    """Puts text between the marks of a file, which is made where it is not there."""
    old = file.read_text(encoding="utf-8") if file.exists() else f"# Leaderboard\n\n{BEGIN}\n{END}\n"
    before, _, rest = old.partition(BEGIN)
    after = rest.partition(END)[2] or "\n"
    new = f"{before.rstrip()}\n\n{BEGIN}\n{text}\n{END}{after}"
    atomic.write_atomically(file, lambda part: part.write_text(new, encoding="utf-8"))


def _picture(reaches: str) -> str:
    """The file of a source's learning curves."""
    return f"curves-{reaches}.png"


def _sections(rows: pd.DataFrame, drawn: set[str]) -> Iterator[str]:
    """The README's tables, as Markdown: for each source, scores on every split, then how episodes of `test` end.

    Ranks are those on `test`. Sources in `drawn` have a picture of learning curves.
    """
    for reaches, group in rows.groupby("reaches", sort=False):
        names = [name for name in SPLIT_NAMES if name in set(group["split"])]
        ranked = group[group["split"] == "test"]["method"].tolist()
        yield f"\n## {reaches} reaches\nMean return of 20 with its 95 % interval, and successes [%].\n"
        yield _line(["rank", "method", "seeds", "tier", *(f"`{name}`" for name in names)])
        yield _line(["---"] * (4 + len(names)))
        for method in ranked:
            own = group[group["method"] == method].set_index("split")
            rank, (seeds, tier) = own["rank"].loc["test"], own[["seeds", "tier"]].iloc[0]
            cells = [f"{rank:.0f}".replace("nan", ""), f"`{method}`", seeds, tier]
            yield _line([*cells, *(_score(own, name) for name in names)])
        if reaches in drawn:
            yield f"\n![Learning curves on {reaches} reaches]({_picture(str(reaches))})"
        yield "\nHow episodes of `test` end [%] ([docs/diagnosis.md](../docs/diagnosis.md)); closing lag in seconds.\n"
        yield _line(["method", *CAUSES, "closing lag"])
        yield _line(["---", *["---:"] * (len(CAUSES) + 1)])
        for row in group[group["split"] == "test"].to_dict("records"):
            shares = [f"{100 * row[cause] / row['episodes']:.1f}" for cause in CAUSES]
            lag = "" if pd.isna(row["closing_lag"]) else f"{row['closing_lag']:.2f}"
            yield _line([f"`{row['method']}`", *shares, lag])


def _score(own: pd.DataFrame, split: str) -> str:
    if split not in own.index:
        return ""
    row = own.loc[split]
    low, high = f"{row['return_low']:.2f}", f"{row['return_high']:.2f}"
    return f"{row['return']:.2f} [{low}, {high}], {100 * row['success']:.1f} %"


def _line(cells: list[Any]) -> str:
    return "| " + " | ".join(map(str, cells)) + " |"
