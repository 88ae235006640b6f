"""Fills the numbers and tables in the documentation from data, so that nobody types them.

A number stands in a Markdown file between two comments, `<!--=KEY-->` and `<!--.-->`. The words of a key:

| key | value |
| --- | --- |
| `METHOD REACHES SPLIT return` | mean return of a row of the leaderboard, such as 17.6 |
| `METHOD REACHES SPLIT success` | success rate of that row [%] |
| `METHOD REACHES SPLIT seeds` | success rate of each of its seeds [%] |
| `results REACHES` | a table of all methods on a source: mean return and success rate [%] on each split |
| `METHOD REACHES SPLIT CAUSE` | share of its episodes that end with a cause [%]; `-` stands for a blank |
| `search REACHES draws`, `settings`, `kept`, `solved` | a count of the search for experts |
| `search REACHES kept_rate`, `solved_rate` | a rate of the search, per draw [%] |
| `search totals`, `regions`, `d_c`, `duration` | a table of both searches |
| `split REACHES SPLIT rows` | rows of a split |
| `split REACHES SPLIT narrow` | share of its rows with a window of at most 0.08 [%] |
| `physics` | the first digits of the hash of the physics |
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import get_args

import pandas as pd
from msgspec import structs

from dextron_bench.evaluation.results import Result
from dextron_bench.experts import database
from dextron_bench.leaderboard.collect import RESULTS
from dextron_bench.reaches.sources import RankedSource
from dextron_bench.runs import result_files
from dextron_bench.scores import standings
from dextron_bench.splits import hard
from dextron_bench.splits.loading import load_split
from dextron_bench.splits.names import SPLIT_NAMES
from dextron_bench.storage import atomic
from dextron_bench.world import model

NUMBER = re.compile(r"<!--=([^>]*?)-->(.*?)<!--\.-->", re.DOTALL)
SEARCHED = get_args(RankedSource)
ANGLES = ("angle 0", "angle 1", "angle 2", "angle 3")


class UnknownNumber(LookupError):
    """A key in a document that names no number; the message names the document and the key."""


def fill(files: Iterable[Path], board: Path) -> list[Path]:
    """Writes the present value of every number into Markdown files; returns the files that changed.

    `board` is the leaderboard's folder. Raises UnknownNumber, DamagedFile, BadInput.
    """
    value = _values(board)
    changed = []
    for file in files:
        old = file.read_text(encoding="utf-8")
        new = NUMBER.sub(lambda match, file=file: _filled(file, match[1], value), old)
        if new != old:
            atomic.write_atomically(file, lambda part, new=new: part.write_text(new, encoding="utf-8"))
            changed.append(file)
    return changed


def _filled(file: Path, key: str, value: Callable[[str], str]) -> str:
    try:
        return f"<!--={key}-->{value(key)}<!--.-->"
    except (LookupError, ValueError, FileNotFoundError) as error:
        raise UnknownNumber(f"{file}: {key!r} names no number ({error})") from error


def _values(board: Path) -> Callable[[str], str]:
    """The text of each key."""

    @cache
    def results() -> list[Result]:
        return list(result_files.results(board / RESULTS))

    @cache
    def rows() -> pd.DataFrame:
        return standings.table(results())

    def value(key: str) -> str:
        match key.split():
            case ["physics"]:
                return model.mjcf_hash()[:8]
            case ["results", reaches]:
                return _results(rows(), reaches)
            case ["search", "totals"]:
                return _totals()
            case ["search", "regions"]:
                return _regions()
            case ["search", ("d_c" | "duration") as by]:
                return _bands(by)
            case ["search", reaches, name]:
                return _search(database.load_shipped(reaches)[1], name)
            case ["split", reaches, name, "rows"]:
                return f"{len(load_split(reaches, name)):,}"
            case ["split", reaches, name, "narrow"]:
                split = load_split(reaches, name)
                return f"{100 * sum(case.window <= hard.WINDOW for case in split.cases) / len(split):.1f}"
            case [method, reaches, split, "seeds"]:
                return _of_seeds(results(), method, reaches, split)
            case [method, reaches, split, name]:
                return _of_row(rows(), method, reaches, split, name)
        raise KeyError(key)

    return value


def _of_row(rows: pd.DataFrame, method: str, reaches: str, split: str, name: str) -> str:
    """A number of the leaderboard's row of a method on a split."""
    selected = rows[(rows["method"] == method) & (rows["reaches"] == reaches) & (rows["split"] == split)]
    if len(selected) != 1:
        raise KeyError(f"the leaderboard has {len(selected)} such rows")
    row = selected.iloc[0]
    if name == "return":
        return f"{row['return']:.1f}"
    share = row["success"] if name == "success" else row[name.replace("-", " ")] / row["episodes"]
    return f"{100 * share:.1f}"


def _of_seeds(results: Iterable[Result], method: str, reaches: str, split: str) -> str:
    """The success rates of the seeds of a method on a split [%], in the order of the seeds."""
    seeds = {
        result.seed: result.splits[split].causes.get("solved", 0) / len(result.splits[split].scores)
        for result in results
        if (result.method, result.reaches) == (method, reaches) and split in result.splits
    }
    if not seeds:
        raise KeyError("the leaderboard has no such row")
    return ", ".join(f"{100 * seeds[seed]:.1f}" for seed in sorted(seeds))


def _results(rows: pd.DataFrame, reaches: str) -> str:
    """Mean return and success rate [%] of every method on each split of a source, best on `test` first."""
    rows = rows[rows["reaches"] == reaches]
    splits = [name for name in SPLIT_NAMES if name in set(rows["split"])]
    if "test" not in splits:
        raise KeyError(f"no method has a row on `test` of {reaches}")
    cells = {
        (row["method"], row["split"]): f"{row['return']:.1f}, {100 * row['success']:.1f} %"
        for row in rows.to_dict("records")
    }
    on_test = rows[rows["split"] == "test"].sort_values("return", ascending=False, kind="stable")
    lines = [
        [f"`{row['method']}`", str(row["seeds"]), *(cells.get((row["method"], name), "") for name in splits)]
        for row in on_test.to_dict("records")
    ]
    return _markdown(["method", "seeds", *(f"`{name}`" for name in splits)], lines)


def _search(summary: database.Summary, name: str) -> str:
    counts = structs.asdict(summary)
    if name in ("kept_rate", "solved_rate"):
        return f"{100 * counts[name.removesuffix('_rate')] / summary.draws:.2f}"
    return f"{counts[name]:,}"


def _totals() -> str:
    """Counts and rates of both searches."""
    names = ("draws", "settings", "kept", "solved", "kept_rate", "solved_rate")
    columns = ["reaches", *names[:4], "kept %", "solved %"]
    summaries = {reaches: database.load_shipped(reaches)[1] for reaches in SEARCHED}
    return _markdown(columns, [[f"`{r}`", *(_search(s, name) for name in names)] for r, s in summaries.items()])


def _regions() -> str:
    """The rate of solved draws [%] of both searches by start region."""
    rates = [_rates(reaches, "region") for reaches in SEARCHED]
    lines = [
        [
            f"ring {ring}",
            *(" / ".join(of_source.get(f"{ring}{angle}", "") for of_source in rates) for angle in range(4)),
        ]
        for ring in range(4)
    ]
    return _markdown(["", *ANGLES], lines)


def _bands(by: str) -> str:
    """The rate of solved draws [%] of both searches by d_c or by duration [s]."""
    rates = {reaches: _rates(reaches, by) for reaches in SEARCHED}
    bands = sorted(
        {band for of_source in rates.values() for band in of_source}, key=lambda band: float(band.split()[0])
    )
    return _markdown([by, *bands], [[f"`{r}`", *(rate.get(band, "") for band in bands)] for r, rate in rates.items()])


def _rates(reaches: str, by: str) -> dict[str, str]:
    statistics = database.load_shipped(reaches)[1].statistics
    return {row.value: f"{100 * row.solved_rate:.2f}" for row in statistics if row.by == by}


def _markdown(columns: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A table, on lines of its own."""
    rows = [columns, ["---"] * len(columns), *lines]
    return "\n\n" + "\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n\n"
