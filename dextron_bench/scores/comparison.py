"""Compares two methods on the settings that both played (docs/statistics.md)."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.results import Result
from dextron_bench.scores import paired, statistics
from dextron_bench.splits import strata
from dextron_bench.world import task

ALL = "all"  # The group of all settings.
Results = Sequence[Result]  # One for each seed.


@dataclass(frozen=True, slots=True)
class SeedScores:
    """Scores (seeds, settings) of one method on one version of a split, given by its digest."""

    name: str
    reaches: str
    split: str
    digest: str
    scores: np.ndarray


@dataclass(frozen=True, slots=True)
class Comparison:
    """How much more B scores than A: `score` (of 20), `success` (of 1), and the `p_value` of McNemar's test.

    `flips` has a row for each setting with a different outcome: `row`, `gained` (by B), the shares of seeds that solve
    it, `a` and `b`, and `subject`, `ring` and `angle` if the split ships. `groups` has a row for ALL settings, for each
    subject and for each start region: `group`, `rows`, mean returns `a` and `b`, `difference`, `low`, `high`,
    `p_value`, and `p_holm`, which is corrected for all rows but the first.
    """

    a: SeedScores
    b: SeedScores
    score: paired.Difference
    success: paired.Difference
    p_value: float
    flips: pd.DataFrame
    groups: pd.DataFrame


def compare(a: SeedScores, b: SeedScores) -> Comparison:
    """Compares two methods that `align` put on the same settings. Raises BadInput."""
    rows = strata.shipped_strata(a.reaches, a.split, a.digest)
    solved_a, solved_b = _solved(a), _solved(b)
    flips = paired.flips(solved_a > 0.0, solved_b > 0.0)
    return Comparison(
        a,
        b,
        paired.difference(a.scores, b.scores),
        paired.difference(solved_a, solved_b, statistics.SHARES),
        flips.p_value,
        _flip_table(flips, solved_a, solved_b, rows),
        _with_holm(pd.DataFrame(_groups(a.scores, b.scores, rows)), first=1),
    )


def pairs(methods: Sequence[SeedScores]) -> pd.DataFrame:
    """A row for each pair of methods that `align` put on the same settings, `a` before `b` as they are given.

    `difference` is how much more B scores, with `low` and `high`, its `p_value`, and `p_holm`, corrected for all
    pairs. `success`, `success_low` and `success_high` are the same in success rate (of 1).
    """
    return _with_holm(pd.DataFrame(_pair(a, b) for a, b in itertools.combinations(methods, 2)))


def _pair(a: SeedScores, b: SeedScores) -> dict[str, str | float]:
    success = paired.difference(_solved(a), _solved(b), statistics.SHARES)
    ends = {"success": success.mean, "success_low": success.low, "success_high": success.high}
    return {"a": a.name, "b": b.name, **_difference(paired.difference(a.scores, b.scores)), **ends}


def _difference(difference: paired.Difference) -> dict[str, float]:
    ends = {"difference": difference.mean, "low": difference.low, "high": difference.high}
    return {**ends, "p_value": difference.p_value}


def _solved(method: SeedScores) -> np.ndarray:
    """Successes (seeds, settings) as 0 and 1."""
    return np.equal(method.scores, task.SUCCESS).astype(float)


def _with_holm(table: pd.DataFrame, first: int = 0) -> pd.DataFrame:
    """The table with `p_holm`: the p values corrected together from row `first` on, and unchanged before it."""
    p_values = table["p_value"].tolist()
    return table.assign(p_holm=[*p_values[:first], *paired.holm(p_values[first:])])


def _flip_table(
    flips: paired.Flips, solved_a: np.ndarray, solved_b: np.ndarray, rows: pd.DataFrame | None
) -> pd.DataFrame:
    changed = np.sort(np.concatenate([flips.gained, flips.lost])).astype(int)
    shares = {"a": solved_a.mean(axis=0)[changed], "b": solved_b.mean(axis=0)[changed]}
    table = pd.DataFrame({"row": changed, "gained": np.isin(changed, flips.gained), **shares})
    return table if rows is None else table.join(rows.iloc[changed].reset_index(drop=True))


def _groups(a: np.ndarray, b: np.ndarray, rows: pd.DataFrame | None) -> Iterator[dict[str, str | int | float]]:
    groups = {ALL: np.arange(a.shape[1])}
    if rows is not None:
        groups |= {f"subject {name}": members for name, members in sorted(rows.groupby("subject").indices.items())}
        regions = "ring " + rows["ring"].astype(str) + ", angle " + rows["angle"].astype(str)
        groups |= {str(name): members for name, members in sorted(rows.groupby(regions).indices.items())}
    for name, members in groups.items():
        difference = _difference(paired.difference(a[:, members], b[:, members]))
        means = {"a": float(a[:, members].mean()), "b": float(b[:, members].mean())}
        yield {"group": name, "rows": len(members), **means, **difference}


def align_all(names: Sequence[str], results: Sequence[Results], split: str, reaches: str | None) -> list[SeedScores]:
    """The scores of two or more methods on the same settings; raises BadInput, as `align` does."""
    first, second = align((names[0], names[1]), (results[0], results[1]), split, reaches)
    others = zip(names[2:], results[2:], strict=True)
    return [
        first,
        second,
        *(align((first.name, name), (results[0], seeds), split, first.reaches)[1] for name, seeds in others),
    ]


def align(
    names: tuple[str, str], results: tuple[Results, Results], split: str, reaches: str | None
) -> tuple[SeedScores, SeedScores]:
    """The scores of A and B on the same settings; `reaches` may be None if only one source has results of both.

    Raises BadInput.
    """
    sources_a, sources_b = ({result.reaches for result in seeds} for seeds in results)
    source = _common_source(sources_a, sources_b, reaches)
    a, b = (_seed_scores(name, seeds, source, split) for name, seeds in zip(names, results, strict=True))
    worlds = {result.physics[:8] for seeds in results for result in seeds if result.reaches == source}
    if len(worlds) > 1:
        raise BadInput(f"the results were played with different physics, {_sorted_list(worlds)}; run the older again")
    if (a.digest, a.scores.shape[1]) != (b.digest, b.scores.shape[1]):
        raise BadInput(
            f"{a.name} and {b.name} played different versions of {split} of {source} reaches, "
            f"{a.digest[:8]} and {b.digest[:8]}; run the older one again"
        )
    return a, b


def _seed_scores(name: str, results: Results, reaches: str, split: str) -> SeedScores:
    seeds = [result for result in results if result.reaches == reaches]
    if without_split := [result for result in seeds if split not in result.splits]:
        advice = "; play it, or give the path of other results"
        if without_split != seeds:
            advice = "; other seeds have it: to compare one of them, give its folder"
        raise BadInput(
            f"{name}, seed {without_split[0].seed}, has no split {split!r} of {reaches} reaches; "
            f"it has {_sorted_list(without_split[0].splits)}{advice}"
        )
    splits = [result.splits[split] for result in seeds]
    if len({(result.digest, len(result.scores)) for result in splits}) > 1:
        raise BadInput(f"the seeds of {name} played different versions of {split} of {reaches} reaches; run them again")
    return SeedScores(name, reaches, split, splits[0].digest, np.array([result.scores for result in splits], float))


def _common_source(sources_a: set[str], sources_b: set[str], requested: str | None) -> str:
    """The requested source of reaches, or the only one, if both methods have results on it."""
    common = sources_a & sources_b
    if not common:
        raise BadInput(
            f"A has results on {_sorted_list(sources_a)} reaches, B on {_sorted_list(sources_b)} reaches: "
            "no source is common to both"
        )
    if requested is None and len(common) > 1:
        raise BadInput(f"both have results on {_sorted_list(common)} reaches; choose one with --reaches")
    if requested is not None and requested not in common:
        raise BadInput(f"both have results on {_sorted_list(common)} reaches, but not both on {requested} reaches")
    return requested or next(iter(common))


def _sorted_list(names: Iterable[str]) -> str:
    return ", ".join(sorted(names))
