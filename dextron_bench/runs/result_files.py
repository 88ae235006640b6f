"""The two sides of a comparison: results found by label or path, and their scores on the same settings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation.episodes import action_hashes
from dextron_bench.methods import registry
from dextron_bench.runs import result_files
from dextron_bench.runs.run_files import CONFIG, PROVENANCE
from dextron_bench.storage import atomic

PUBLISHED = Path("leaderboard/results")
Results = Sequence[dict[str, Any]]


class UnknownResult(LookupError):
    """A name by which no result is found."""


def find(name: str, runs: Path) -> Results:
    """One method's results: by its label in a folder of runs, else among the published ones, else by a path.

    A path is a `result.json`, a run's folder, or the folder of a method's runs. Raises UnknownResult, DamagedFile.
    """
    files: list[Path] = []
    if registry.NAME.fullmatch(name):
        every = (sorted(folder.glob(f"{name}/*/seed*/{result_files.RESULT}")) for folder in (runs, PUBLISHED))
        files = next(filter(None, every), [])
    if not files:
        path, folders = Path(name), ("", "seed*/", "*/seed*/")
        files = (
            [path]
            if path.is_file()
            else [file for each in folders for file in sorted(path.glob(each + result_files.RESULT))]
        )
    if not files:
        raise UnknownResult(
            f"no result of {name!r}; {runs} and {PUBLISHED} have {_known(runs)}, or give the path of a run"
        )
    results = [result_files.read_result(file) for file in files]
    if len(labels := {result["method"] for result in results}) > 1:
        raise UnknownResult(f"{name!r} holds results of {_listed(labels)}; give one of them")
    return results


def _known(runs: Path) -> str:
    files = [file for folder in (runs, PUBLISHED) for file in folder.glob(f"*/*/seed*/{result_files.RESULT}")]
    return _listed({file.parts[-4] for file in files}) or "none"


def _listed(names: Sequence[str] | set[str] | dict[str, Any]) -> str:
    return ", ".join(sorted(names))


RESULT = "result.json"


MAKER = ("method", "code", "settings")  # Of a run's config, what a result repeats: by it the agent is made again.


def conclude(folder: Path, episodes: pd.DataFrame, about: dict[str, Any], seconds: float | None = None) -> None:
    """Writes the result: every episode's score, from which the leaderboard is computed, and how episodes end.

    `seconds` of training are part of where it was made, which differs from one making to the next.
    """
    made = atomic.read_json(folder / CONFIG)
    found = {"splits": scores(episodes), "provenance": atomic.read_json(folder / PROVENANCE)}
    found["provenance"] |= {} if seconds is None else {"seconds": seconds}
    found["maker"] = {name: made[name] for name in MAKER if name in made}
    atomic.write_json(folder / RESULT, {**about, **found})


def scores(episodes: pd.DataFrame) -> dict[str, Any]:
    """What a result says of each split, from the rows of its episodes."""
    return {str(name): _scores(rows) for name, rows in episodes.groupby("split", sort=False)}


def _scores(rows: pd.DataFrame) -> dict[str, Any]:
    told = {
        "digest": rows["digest"].iloc[0],
        "scores": rows["score"].tolist(),
        "failed": int((rows["failure"] != "").sum()),
        "causes": {cause: int(count) for cause, count in rows["cause"].value_counts(sort=False).items()},
        "closing_lag": None if rows["closing_lag"].isna().all() else round(float(rows["closing_lag"].median()), 3),
    }
    kept = rows["actions"] if "actions" in rows else pd.Series([None])
    return told if kept.isna().any() else told | {"actions": action_hashes(kept)}


def results(folder: Path) -> Iterator[dict[str, Any]]:
    """Every result below a folder of runs; raises DamagedFile."""
    for file in sorted(folder.glob(f"*/*/seed*/{RESULT}")):
        yield read_result(file)


def read_result(file: Path) -> dict[str, Any]:
    """The content of a `result.json`; raises DamagedFile."""
    found = atomic.read_json(file)
    try:
        parts = [found["method"], found["reaches"], found["seed"]]
        for each in found["splits"].values():
            parts += [each["digest"][:8], sum(each["scores"]), each["failed"], sum(each["causes"].values())]
    except (KeyError, TypeError, AttributeError) as error:
        raise atomic.DamagedFile(file, f"no result: {type(error).__name__} {error}") from error
    return found
