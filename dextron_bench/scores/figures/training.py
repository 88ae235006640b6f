"""Pictures of training: scores and losses against epochs."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from dextron_bench.scores.cells import counted
from dextron_bench.scores.figures.pictures import check_format, save

PART = "-quick"  # Ends the label of a training with the first fifth of the paper's budget.


def learning_curves(
    curves: dict[str, dict[int, pd.DataFrame]], rows: pd.DataFrame, file: Path, epochs: str = "epochs of 1,000 frames"
) -> None:
    """Draws mean and range over seeds of the return on `val` against epochs (paper, Fig. 4a and 4c).

    `curves` has a table for each method and seed, with columns `epoch` and `return`. A method in the leaderboard's
    `rows` without curves is a line at its return on `test`. `epochs` is the label of the axis. A method with a part of
    the paper's budget is left out where the whole is drawn. Raises UnknownFormat, OSError.
    """
    check_format(file)
    drawn = without_parts({*curves, *rows["method"]})
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    for index, (label, seeds) in enumerate((label, curves[label]) for label in drawn if label in curves):
        table = pd.concat([points.set_index("epoch")["return"] for points in seeds.values()], axis=1)
        mean, colour = table.mean(axis=1), f"C{index}"
        axes.plot(table.index, mean, color=colour, label=f"{label} ({counted(len(seeds), 'seed')})", linewidth=1.5)
        axes.fill_between(table.index, table.min(axis=1), table.max(axis=1), color=colour, alpha=0.15, linewidth=0)
    constant = rows[(rows["split"] == "test") & rows["method"].isin(set(drawn) - set(curves))]
    for index, row in enumerate(constant.to_dict("records"), start=len(curves)):
        style = ("--", ":", "-.")[index % 3]
        axes.axhline(row["return"], color=f"C{index}", linewidth=1, linestyle=style, label=f"{row['method']} (on test)")
    axes.set(xlabel=epochs, ylabel="sum of rewards", ylim=(0.0, 20.5), xlim=(0.0, None))
    axes.set_title("Mean and range over seeds on 50 settings of val")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    save(figure, file, 150)


def without_parts(labels: Collection[str]) -> list[str]:
    """Sorted labels, without `x-quick` where `x` is there: its training begins with the same epochs."""
    return sorted(label for label in labels if not label.endswith(PART) or label.removesuffix(PART) not in labels)


def success_curve(points: list[dict[str, float]], file: Path) -> None:
    """Draws loss and accuracy of the success model on training and held-out episodes against epochs (paper, Fig. 4b).

    Raises UnknownFormat, OSError.
    """
    check_format(file)
    figure = Figure(figsize=(8, 3.5), layout="constrained")
    table = pd.DataFrame(points).set_index("epoch")
    for axes, name in zip(figure.subplots(1, 2), ("loss", "accuracy"), strict=True):
        axes.plot(table.index, table[name], label="episodes learned from")
        axes.plot(table.index, table[f"test_{name}"], label="episodes held out")
        axes.set(xlabel="epoch", ylabel="cross entropy" if name == "loss" else name)
        axes.legend(fontsize=8)
    save(figure, file, 150)
