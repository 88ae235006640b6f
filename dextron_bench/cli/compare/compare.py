"""`dextron-bench compare`: compares methods on the settings that all of them played."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.compare import pairs
from dextron_bench.cli.compare.cells import DIFFERENCE, HOLM, difference_text
from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_json, print_table
from dextron_bench.reaches.sources import SourceName

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.scores.comparison import Comparison
    from dextron_bench.scores.paired import Difference

SHOWN = 5  # How many settings are listed that more seeds of B solve, and that fewer do.


class OnlyForTwo(ValueError):
    """A flag that needs exactly two methods."""


@dataclass(frozen=True)
class Compare:
    """Compare methods on equal settings: how much more B scores than A, with its 95 % interval.

    A and B are names on the leaderboard, found in --runs if the split was played there, or else among the published
    results. They can also be paths:
    a result.json, the folder of a run, or the folder of a method's runs. With three methods or more, the table has
    all pairs, and its p values are corrected for their number. docs/statistics.md explains the numbers.

    Example: dextron-bench compare rlil-0.1-quick rlil-0.1 --reaches real --into difference.png

    Example: dextron-bench compare reflex omega bc rlil-0.1 --reaches real

    Example: dextron-bench compare old/ours/synthetic runs/ours/synthetic --fail-if-worse
    """

    a: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="A")]
    """The method to compare with: a label or a path."""
    b: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="B")]
    """The method that may be better or worse: a label or a path."""
    others: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="C")] = ()
    """More methods: then all pairs are compared."""
    split: str = "test"
    """The split that all played."""
    reaches: SourceName | None = None
    """The source of reaches; needed only if the methods have results on several."""
    runs: flags.Runs = flags.RUNS
    into: flags.Picture = None
    """Also draw the differences into this file."""
    fail_if_worse: bool = False
    """Exit with code 1 if B is worse beyond noise: if the whole interval of the difference B - A is below 0."""
    json: bool = False
    """Print everything as JSON, with all settings whose outcome differs."""

    def __call__(self) -> int:
        from dextron_bench.runs import result_files
        from dextron_bench.scores import comparison

        if self.others and (self.into is not None or self.fail_if_worse):
            raise OnlyForTwo("--into and --fail-if-worse need two methods, not more")
        names = (self.a, self.b, *self.others)
        results = [result_files.find(name, self.runs, self.split) for name in names]
        methods = comparison.align_all(names, results, self.split, self.reaches)
        if self.others:
            pairs.print_pairs(methods, self.json)
            return DONE
        result = comparison.compare(*methods)
        if self.into is not None:
            from dextron_bench.scores.figures import differences

            differences.differences(result, self.into)
        print_json(as_dict(result)) if self.json else _print(result)
        return DIFFERS if self.fail_if_worse and result.score.is_worse else DONE


def as_dict(comparison: Comparison) -> dict[str, Any]:
    """A comparison as values for JSON."""
    a, b = comparison.a, comparison.b
    return {
        **{"a": a.name, "b": b.name, "reaches": a.reaches, "split": a.split, "digest": a.digest},
        **{"seeds": [len(a.scores), len(b.scores)], "rows": a.scores.shape[1]},
        "return": asdict(comparison.score),
        "success": asdict(comparison.success),
        "p_value": comparison.p_value,
        "worse": comparison.score.is_worse,
        "flips": comparison.flips.to_dict("records"),
        "groups": comparison.groups.to_dict("records"),
    }


def _print(comparison: Comparison) -> None:
    from dextron_bench.scores import cells

    _print_scores(comparison)
    _print_flips(comparison.flips, comparison.a.scores.shape[1])
    p_value = cells.p_value(comparison.p_value)
    print(f"McNemar's exact test: p {p_value.replace('<', '< ') if '<' in p_value else f'= {p_value}'}")
    rows = [
        [
            row["group"],
            row["rows"],
            f"{row['a']:.2f}",
            f"{row['b']:.2f}",
            difference_text(row),
            cells.p_value(row["p_holm"]),
        ]
        for row in comparison.groups.to_dict("records")
    ]
    print_table("mean return by group of settings", ["group", "rows", "A", "B", DIFFERENCE, HOLM], rows)
    if len(rows) > 1:
        print(f"{HOLM} is corrected for the number of groups; the line `{rows[0][0]}` is not one of them")


def _print_scores(comparison: Comparison) -> None:
    """Return and success of both methods, with the difference."""
    from dextron_bench.world import task

    a, b = comparison.a, comparison.b
    returns = [f"{side.scores.mean():.2f}" for side in (a, b)]
    successes = [f"{100 * (side.scores == task.SUCCESS).mean():.1f}" for side in (a, b)]
    rows = [
        ["return", *returns, *_difference_cells(comparison.score, 1.0)],
        ["success %", *successes, *_difference_cells(comparison.success, 100.0)],
    ]
    title = f"A = {a.name}, B = {b.name}: {a.reaches} reaches, split {a.split}, version {a.digest[:8]}"
    counts = f"{a.scores.shape[1]} rows, {len(a.scores)} against {len(b.scores)} seeds"
    print_table(f"{title}, {counts}", ["", "A", "B", DIFFERENCE, "smallest detectable"], rows)


def _print_flips(flips: pd.DataFrame, settings: int) -> None:
    """How many settings more seeds of B solve than of A, and how many fewer, with the first rows of each."""
    for word, rows in (("more", flips[flips["gained"]]["row"]), ("fewer", flips[~flips["gained"]]["row"])):
        first = ", ".join(map(str, rows.head(SHOWN))) + (", ..." if len(rows) > SHOWN else "")
        line = f"{len(rows)} of {settings} settings are solved by {word} seeds of B"
        print(f"{line}: rows {first}" if len(rows) else line)


def _difference_cells(difference: Difference, unit: float) -> tuple[str, str]:
    scaled = {"difference": difference.mean, "low": difference.low, "high": difference.high}
    text = difference_text({name: unit * value for name, value in scaled.items()})
    return text, f"{unit * difference.detectable:.2f}"
