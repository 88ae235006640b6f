"""`dextron-bench compare`: two methods on the settings that both played."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from dextron_bench.cli.output import print_json, print_table

if TYPE_CHECKING:
    from dextron_bench.scores.comparison import Comparison
    from dextron_bench.scores.paired import Difference

WORSE = 1  # Exit code.
SHOWN = 5  # Settings named of each way to flip.


@dataclass(frozen=True)
class Compare:
    """Compare two methods on equal settings: what B scores more than A, with its 95 % interval.

    A and B are called as on the leaderboard and looked for in --runs, then in leaderboard/results; or they are paths:
    a result.json, a run's folder, or the folder of a method's runs. What the numbers mean: docs/statistics.md.

    Example: dextron-bench compare rlil-0.1-quick rlil-0.1 --reaches real --into difference.png

    Example: dextron-bench compare old/ours/synthetic runs/ours/synthetic --fail-if-worse
    """

    a: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="A")]
    """The method to compare with: a label or a path."""
    b: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="B")]
    """The method that may be better or worse: a label or a path."""
    split: str = "test"
    """The split that both played."""
    reaches: Literal["real", "synthetic", "minjerk"] | None = None
    """The source of reaches; may be left out where both played on one alone."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    into: Annotated[Path | None, tyro.conf.arg(metavar="FILE.png|svg|pdf")] = None
    """Draw the differences into this file."""
    fail_if_worse: bool = False
    """End with code 1 where B is worse beyond noise: where the whole interval of B's return less A's is below 0."""
    json: bool = False
    """Print everything as JSON, with all settings that flip."""

    def __call__(self) -> int:
        from dextron_bench.runs import result_files
        from dextron_bench.scores import comparison

        results = result_files.find(self.a, self.runs), result_files.find(self.b, self.runs)
        found = comparison.compare(*comparison.align((self.a, self.b), results, self.split, self.reaches))
        if self.into is not None:
            from dextron_bench.scores import figures

            figures.differences(found, self.into)
        print_json(plain(found)) if self.json else _print(found)
        return WORSE if self.fail_if_worse and found.score.is_worse else 0


def plain(found: Comparison) -> dict[str, Any]:
    """A comparison as values that JSON has."""
    a, b = found.a, found.b
    return {
        **{"a": a.name, "b": b.name, "reaches": a.reaches, "split": a.split, "digest": a.digest},
        **{"seeds": [len(a.scores), len(b.scores)], "rows": a.scores.shape[1]},
        "return": asdict(found.score),
        "success": asdict(found.success),
        "p_value": found.p_value,
        "worse": found.score.is_worse,
        "flips": found.flips.to_dict("records"),
        "groups": found.groups.to_dict("records"),
    }


def _print(found: Comparison) -> None:
    from dextron_bench.world import task

    a, b = found.a, found.b
    cells = [
        ["return", f"{a.scores.mean():.2f}", f"{b.scores.mean():.2f}", *_told(found.score, 1.0)],
        [
            "success %",
            *(f"{100 * (side.scores == task.SUCCESS).mean():.1f}" for side in (a, b)),
            *_told(found.success, 100.0),
        ],
    ]
    rows, seeds = a.scores.shape[1], f"{len(a.scores)} against {len(b.scores)} seeds"
    title = f"A = {a.name}, B = {b.name}: {a.reaches} reaches, split {a.split}, version {a.digest[:8]}"
    print_table(f"{title}, {rows} rows, {seeds}", ["", "A", "B", "B - A [95 %]", "smallest that shows"], cells)
    for word, own in (("more", found.flips[found.flips["gained"]]), ("fewer", found.flips[~found.flips["gained"]])):
        first = ", ".join(map(str, own["row"].head(SHOWN))) + (", ..." if len(own) > SHOWN else "")
        print(
            f"{len(own)} of {rows} settings are solved by {word} seeds of B" + (f": rows {first}" if len(own) else "")
        )
    print(f"McNemar's exact test: p = {found.p_value:.3g}")
    columns = ["group", "rows", "A", "B", "B - A [95 %]"]
    groups = [
        [
            row["group"],
            row["rows"],
            f"{row['a']:.2f}",
            f"{row['b']:.2f}",
            _interval(row["difference"], row["low"], row["high"]),
        ]
        for row in found.groups.to_dict("records")
    ]
    print_table("mean return by group of settings", columns, groups)


def _told(found: Difference, unit: float) -> tuple[str, str]:
    return _interval(unit * found.mean, unit * found.low, unit * found.high), f"{unit * found.detectable:.2f}"


def _interval(mean: float, low: float, high: float) -> str:
    return f"{mean:+.2f} [{low:+.2f}, {high:+.2f}]"
