"""Pictures of training: scores and losses against epochs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dextron_bench.scores.cells import counted
from dextron_bench.scores.figures.pictures import check_format, save

PARTS = ("-quick", "-tenth")  # End the label of a training with the first fifth or tenth of the paper's budget.
PANELS = 4  # Beside each other: one for each method with several seeds.
OVERVIEW, PANEL = 5.0, 1.6  # Heights of the axes with all methods, and of a row of panels [inches].
LIMITS = (0.0, 20.5)


def learning_curves(
    curves: dict[str, dict[int, pd.DataFrame]], rows: pd.DataFrame, file: Path, epochs: str = "epochs of 1,000 frames"
) -> None:
    """Draws the return on `val` against epochs (paper, Fig. 4a and 4c): medians over seeds, and below them each seed.

    `curves` has a table for each method and seed, with columns `epoch` and `return`. A method in the leaderboard's
    `rows` without curves is a line at its return on `test`. `epochs` is the label of the axis. A method with a part of
    the paper's budget is left out where the whole is drawn. Raises UnknownFormat, OSError.
    """
    check_format(file)
    drawn = without_parts({*curves, *rows["method"]})
    tables = {label: _by_seed(curves[label]) for label in drawn if label in curves}
    colours = {label: f"C{index}" for index, label in enumerate(tables)}
    with_spread = [label for label, table in tables.items() if table.shape[1] > 1]
    heights = [OVERVIEW, *[PANEL] * -(-len(with_spread) // PANELS)]
    figure = Figure(figsize=(8, sum(heights)), layout="constrained")
    parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    axes = parts[0].subplots()
    for label, table in tables.items():
        text = f"{label} ({counted(table.shape[1], 'seed')})"
        axes.plot(table.index, table.median(axis=1), color=colours[label], label=text, linewidth=1.5)
    constant = rows[(rows["split"] == "test") & rows["method"].isin(set(drawn) - set(curves))]
    for index, row in enumerate(constant.to_dict("records"), start=len(tables)):
        style = ("--", ":", "-.")[index % 3]
        axes.axhline(row["return"], color=f"C{index}", linewidth=1, linestyle=style, label=f"{row['method']} (on test)")
    axes.set(xlabel=epochs, ylabel="sum of rewards", ylim=LIMITS, xlim=(0.0, None))
    axes.set_title("Return on 50 settings of val" + (": median over seeds, and each seed" if with_spread else ""))
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    panels = [panel for part in parts[1:] for panel in part.subplots(1, PANELS)]
    _draw_seeds(panels, {label: tables[label] for label in with_spread}, colours, axes)
    save(figure, file, 150)


def _draw_seeds(
    panels: Sequence[Axes], tables: Mapping[str, pd.DataFrame], colours: Mapping[str, str], overview: Axes
) -> None:
    """Draws each seed of each method, a method in a panel, and removes the panels that are left."""
    for panel in panels[len(tables) :]:
        panel.remove()
    for panel, (label, table) in zip(panels, tables.items(), strict=False):
        panel.plot(table.index, table, color=colours[label], linewidth=0.7)
        panel.set(ylim=LIMITS, yticks=(0, 10, 20), xlim=overview.get_xlim(), xticks=overview.get_xticks()[::2][:-1])
        panel.set_title(label, fontsize=9)
        panel.tick_params(labelsize=8)


def _by_seed(points: Mapping[int, pd.DataFrame]) -> pd.DataFrame:
    """Returns by epoch, a column for each seed."""
    return pd.concat([table.set_index("epoch")["return"] for table in points.values()], axis=1)


def without_parts(labels: Collection[str]) -> list[str]:
    """Sorted labels, without `x-quick` and `x-tenth` where `x` is there: its training begins with the same epochs."""
    parts = {label + part for label in labels for part in PARTS}
    return sorted(label for label in labels if label not in parts)


def success_curve(points: list[dict[str, float]], file: Path) -> None:
    """Draws loss and accuracy of the success model on learned and held-out settings against epochs (paper, Fig. 4b).

    Raises UnknownFormat, OSError.
    """
    check_format(file)
    figure = Figure(figsize=(8, 3.5), layout="constrained")
    table = pd.DataFrame(points).set_index("epoch")
    for axes, name in zip(figure.subplots(1, 2), ("loss", "accuracy"), strict=True):
        axes.plot(table.index, table[name], label="settings learned from")
        axes.plot(table.index, table[f"test_{name}"], label="held out")
        axes.set(xlabel="epoch", ylabel="cross entropy" if name == "loss" else name)
        axes.legend(fontsize=8)
    save(figure, file, 150)
