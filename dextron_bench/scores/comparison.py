"""Two methods compared on the settings that both played (docs/statistics.md)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.runs.result_files import Results, _listed
from dextron_bench.scores import paired
from dextron_bench.splits import strata
from dextron_bench.world import task

ALL = "all"  # The group of all settings.


@dataclass(frozen=True, slots=True)
class Comparison:
    """What side B scores more than side A: `score` (of 20) and `success` (of 1), with `p_value` of McNemar's test.

    `flips` has a row for each setting of another outcome: `row`, `gained` (by B), the shares of seeds that solve it,
    `a` and `b`, and `subject`, `ring` and `angle` where the split ships. `groups` has one for ALL settings, for each
    subject and for each start region: `group`, `rows`, mean returns `a` and `b`, `difference`, `low`, `high`.
    """

    a: SeedScores
    b: SeedScores
    score: paired.Difference
    success: paired.Difference
    p_value: float
    flips: pd.DataFrame
    groups: pd.DataFrame


def compare(a: SeedScores, b: SeedScores) -> Comparison:
    """Compares two sides that `sides.pair` made; raises DamagedSplit."""
    rows = strata.shipped(a.reaches, a.split, a.digest)
    solved = [side.scores == task.SUCCESS for side in (a, b)]
    flips = paired.flips(*solved)
    return Comparison(
        a,
        b,
        paired.published(a.scores, b.scores),
        paired.published(*(each.astype(float) for each in solved)),
        flips.p_value,
        _flipped(flips, solved, rows),
        pd.DataFrame(_groups(a.scores, b.scores, rows)),
    )


def _flipped(flips: paired.Flips, solved: list[np.ndarray], rows: pd.DataFrame | None) -> pd.DataFrame:
    changed = np.sort(np.concatenate([flips.gained, flips.lost])).astype(int)
    a, b = (each.mean(axis=0)[changed] for each in solved)
    found = pd.DataFrame({"row": changed, "gained": np.isin(changed, flips.gained), "a": a, "b": b})
    return found if rows is None else found.join(rows.iloc[changed].reset_index(drop=True))


def _groups(a: np.ndarray, b: np.ndarray, rows: pd.DataFrame | None) -> Iterator[dict[str, str | int | float]]:
    groups = {ALL: np.arange(a.shape[1])}
    if rows is not None:
        groups |= {f"subject {name}": own for name, own in sorted(rows.groupby("subject").indices.items())}
        regions = "ring " + rows["ring"].astype(str) + ", angle " + rows["angle"].astype(str)
        groups |= {str(name): own for name, own in sorted(rows.groupby(regions).indices.items())}
    for name, own in groups.items():
        found = paired.published(a[:, own], b[:, own])
        means = {"a": float(a[:, own].mean()), "b": float(b[:, own].mean())}
        interval = {"difference": found.mean, "low": found.low, "high": found.high}
        yield {"group": name, "rows": len(own), **means, **interval}


class Incomparable(ValueError):
    """Results that were not scored on the same settings."""


@dataclass(frozen=True, slots=True)
class SeedScores:
    """Scores (seeds, settings) of one method on the split of a source's reaches that has this digest."""

    name: str
    reaches: str
    split: str
    digest: str
    scores: np.ndarray


def align(
    names: tuple[str, str], results: tuple[Results, Results], split: str, reaches: str | None
) -> tuple[SeedScores, SeedScores]:
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


def _side(name: str, results: Results, reaches: str, split: str) -> SeedScores:
    own = [result for result in results if result["reaches"] == reaches]
    if lacking := [result for result in own if split not in result["splits"]]:
        raise Incomparable(
            f"{name}, seed {lacking[0]['seed']}, has no split {split!r} of {reaches} reaches; "
            f"it has {_listed(lacking[0]['splits'])}"
        )
    seeds = [result["splits"][split] for result in own]
    if len({(found["digest"], len(found["scores"])) for found in seeds}) > 1:
        raise Incomparable(f"seeds of {name} played other versions of {split} of {reaches} reaches; run them again")
    return SeedScores(name, reaches, split, seeds[0]["digest"], np.array([found["scores"] for found in seeds], float))


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
