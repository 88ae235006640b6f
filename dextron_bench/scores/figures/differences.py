"""The picture of a comparison of two methods."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dextron_bench.scores.figures.pictures import check_format, save
from dextron_bench.scores.paired import SIGNIFICANT

if TYPE_CHECKING:
    from dextron_bench.scores.comparison import Comparison

BETTER, WORSE = "tab:blue", "tab:orange"


def differences(comparison: Comparison, file: Path) -> None:
    """Draws how much more B scores than A: mean and interval of each group, and all settings in order of difference.

    Blue means better, orange worse, grey not significant after Holm's correction. Raises UnknownFormat, OSError.
    """
    check_format(file)
    groups = comparison.groups.iloc[::-1]
    figure = Figure(figsize=(10, 1.5 + 0.22 * max(len(groups), 12)), layout="constrained")
    left, right = figure.subplots(1, 2)
    for height, row in enumerate(groups.to_dict("records")):
        colour = "0.5" if row["p_holm"] > SIGNIFICANT else BETTER if row["difference"] > 0.0 else WORSE
        left.plot([row["low"], row["high"]], [height, height], color=colour, linewidth=2)
        left.plot(row["difference"], height, "o", color=colour, markersize=4)
    left.set_yticks(range(len(groups)), [f"{row.group} ({row.rows})" for row in groups.itertuples()], fontsize=8)
    left.set(xlabel="difference of mean return, with its 95 % interval", title="Groups (settings)")
    settings = np.sort(comparison.b.scores.mean(axis=0) - comparison.a.scores.mean(axis=0))
    right.bar(np.arange(len(settings)), settings, width=1.0, color=np.where(settings > 0.0, BETTER, WORSE))
    right.set(xlabel="settings, in order", ylabel="difference of return", ylim=(-20.5, 20.5), title="Each setting")
    for draw in (left.axvline, right.axhline):
        draw(0.0, color="black", linewidth=0.8)
    split = f"{comparison.a.split} of {comparison.a.reaches} reaches"
    figure.suptitle(f"What {comparison.b.name} scores more than {comparison.a.name} on {split}", fontsize=10)
    save(figure, file, 150)
