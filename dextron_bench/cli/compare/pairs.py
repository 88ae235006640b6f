"""`dextron-bench compare` with three methods or more: all pairs, with p values that are corrected for their number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dextron_bench.cli.compare.cells import DIFFERENCE, HOLM, difference_text
from dextron_bench.cli.support.output import print_json, print_table

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.scores.comparison import SeedScores


def print_pairs(methods: Sequence[SeedScores], as_json: bool) -> None:
    """Compares all pairs of methods on the same settings and prints them."""
    from dextron_bench.scores import comparison

    pairs = comparison.pairs(methods)
    if as_json:
        about = {"reaches": methods[0].reaches, "split": methods[0].split, "digest": methods[0].digest}
        seeds = {method.name: len(method.scores) for method in methods}
        print_json({**about, "seeds": seeds, "pairs": pairs.to_dict("records")})
    else:
        _print_table(methods, pairs)


def _print_table(methods: Sequence[SeedScores], pairs: pd.DataFrame) -> None:
    """Each method with its number of seeds, and each pair with its difference and p values."""
    from dextron_bench.scores import cells
    from dextron_bench.scores.paired import SIGNIFICANT
    from dextron_bench.world import task

    first = methods[0]
    title = f"{first.reaches} reaches, split {first.split}, version {first.digest[:8]}, {first.scores.shape[1]} rows"
    means = [
        [one.name, len(one.scores), f"{one.scores.mean():.2f}", f"{100 * (one.scores == task.SUCCESS).mean():.1f}"]
        for one in methods
    ]
    print_table(title, ["method", "seeds", "return", "success %"], means)
    rows = []
    for pair in pairs.to_dict("records"):
        success = {"difference": pair["success"], "low": pair["success_low"], "high": pair["success_high"]}
        texts = difference_text(pair), difference_text({name: 100 * value for name, value in success.items()})
        verdict = "differ" if pair["p_holm"] <= SIGNIFICANT else "within noise"
        rows.append([pair["a"], pair["b"], *texts, *(cells.p_value(pair[p]) for p in ("p_value", "p_holm")), verdict])
    columns = ["A", "B", f"return {DIFFERENCE}", f"success % {DIFFERENCE}", "p", HOLM, ""]
    print_table(f"{len(rows)} pairs; {HOLM} is corrected for all of them", columns, rows)
