"""The two sides of a comparison: results found by label or path, and their scores on the same settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.methods import registry as methods
from dextron_bench.runs import run_files as records

PUBLISHED = Path("leaderboard/results")
Results = Sequence[dict[str, Any]]


class UnknownResult(LookupError):
    """A name by which no result is found."""


class Incomparable(ValueError):
    """Results that were not scored on the same settings."""


@dataclass(frozen=True, slots=True)
class Side:
    """Scores (seeds, settings) of one method on the split of a source's reaches that has this digest."""

    name: str
    reaches: str
    split: str
    digest: str
    scores: np.ndarray


def find(name: str, runs: Path) -> Results:
    """One method's results: by its label in a folder of runs, else among the published ones, else by a path.

    A path is a `result.json`, a run's folder, or the folder of a method's runs. Raises UnknownResult, DamagedFile.
    """
    files: list[Path] = []
    if methods.NAME.fullmatch(name):
        every = (sorted(folder.glob(f"{name}/*/seed*/{records.RESULT}")) for folder in (runs, PUBLISHED))
        files = next(filter(None, every), [])
    if not files:
        path, folders = Path(name), ("", "seed*/", "*/seed*/")
        files = (
            [path]
            if path.is_file()
            else [file for each in folders for file in sorted(path.glob(each + records.RESULT))]
        )
    if not files:
        raise UnknownResult(
            f"no result of {name!r}; {runs} and {PUBLISHED} have {_known(runs)}, or give the path of a run"
        )
    results = [records.read_result(file) for file in files]
    if len(labels := {result["method"] for result in results}) > 1:
        raise UnknownResult(f"{name!r} holds results of {_listed(labels)}; give one of them")
    return results


def pair(
    names: tuple[str, str], results: tuple[Results, Results], split: str, reaches: str | None
) -> tuple[Side, Side]:
    """A and B on the same settings; `reaches` may be None where there is one source that both played.

    Raises Incomparable.
    """
    source = _shared([{result["reaches"] for result in each} for each in results], reaches)
    a, b = (_side(name, each, source, split) for name, each in zip(names, results, strict=True))
    if (a.digest, a.scores.shape[1]) != (b.digest, b.scores.shape[1]):
        raise Incomparable(
            f"{a.name} and {b.name} played other versions of {split} of {source} reaches, "
            f"{a.digest[:8]} and {b.digest[:8]}; run the older one again"
        )
    return a, b


def _side(name: str, results: Results, reaches: str, split: str) -> Side:
    own = [result for result in results if result["reaches"] == reaches]
    if lacking := [result for result in own if split not in result["splits"]]:
        raise Incomparable(
            f"{name}, seed {lacking[0]['seed']}, has no split {split!r} of {reaches} reaches; "
            f"it has {_listed(lacking[0]['splits'])}"
        )
    seeds = [result["splits"][split] for result in own]
    if len({(found["digest"], len(found["scores"])) for found in seeds}) > 1:
        raise Incomparable(f"seeds of {name} played other versions of {split} of {reaches} reaches; run them again")
    return Side(name, reaches, split, seeds[0]["digest"], np.array([found["scores"] for found in seeds], float))


def _shared(played: Sequence[set[str]], asked: str | None) -> str:
    """The source of reaches that both sides played."""
    both = played[0] & played[1]
    if not both:
        raise Incomparable(f"A has results on {_listed(played[0])} reaches, B on {_listed(played[1])}: none in common")
    if asked is None and len(both) > 1:
        raise Incomparable(f"both have results on {_listed(both)} reaches; choose with --reaches")
    if asked is not None and asked not in both:
        raise Incomparable(f"both have results on {_listed(both)} reaches, not both on {asked}")
    return asked or next(iter(both))


def _known(runs: Path) -> str:
    files = [file for folder in (runs, PUBLISHED) for file in folder.glob(f"*/*/seed*/{records.RESULT}")]
    return _listed({file.parts[-4] for file in files}) or "none"


def _listed(names: Sequence[str] | set[str] | dict[str, Any]) -> str:
    return ", ".join(sorted(names))
