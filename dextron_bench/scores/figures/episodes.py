"""Pictures of episodes: what a model predicts in them, and when closing works."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from dextron_bench.experts.openings import NEAR
from dextron_bench.scores.figures.pictures import check_format, save

if TYPE_CHECKING:
    from dextron_bench.evaluation.closing_windows import Choice, Window
    from dextron_bench.success.exemplars import PredictedEpisode

MARKERS = "Dos^vPX*"  # One for each agent, in order.
WORKS, FAILS = "#9fd3a0", "#e9e9e9"
RIDGES = 40  # About how many curves an episode gets.


def ridges(episodes: dict[str, PredictedEpisode], file: Path) -> None:
    """Draws the success that the model predicts for every action, with about RIDGES curves an episode (paper, Fig. 5).

    `episodes` are named by their titles. Time increases upwards, as a share of the reach. A tick marks the chosen
    action. Curves that predict the outcome correctly are green, others are red. Raises UnknownFormat, OSError.
    """
    check_format(file)
    figure = Figure(figsize=(2.6 * len(episodes), 5), layout="constrained")
    panels = figure.subplots(1, len(episodes), sharey=True, squeeze=False)[0]
    for axes, (title, predicted) in zip(panels, episodes.items(), strict=True):
        curves, times = predicted.predictions.curves, predicted.times
        actions = np.linspace(-1.0, 1.0, curves.shape[1])
        shown = range(0, len(times), max(1, len(times) // RIDGES))
        height = 2.5 * times[-1] / len(shown)
        for k in reversed(shown):  # Draws later steps first, so that earlier ones cover them.
            base, colour = times[k], "tab:green" if predicted.correct[k] else "tab:red"
            axes.fill_between(actions, base, base + height * curves[k], color=colour, alpha=0.5, linewidth=0)
            axes.plot(actions, base + height * curves[k], color="0.2", linewidth=0.4)
            axes.plot([predicted.episode.actions[k, 0]] * 2, [base, base + 0.5 * height], color="black", linewidth=1)
        axes.set_title(title, fontsize=8, wrap=True)
        axes.set(xlabel="action", xlim=(-1.0, 1.0))
    panels[0].set_ylabel("time, as a share of the reach")
    save(figure, file, 150)


def windows(windows: Mapping[int, Window], choices: Mapping[str, Sequence[Choice]], title: str, file: Path) -> None:
    """Draws a bar for each row of a split, green while closing works, with a marker where each agent began to close.

    Settings are in the order in which closing begins to work, and 0 s is the first moment that was tried. A filled
    marker is a success. A setting whose hand never came near has no bar. Raises UnknownFormat, OSError.
    """
    check_format(file)
    figure = Figure(figsize=(8, 1.6 + 0.28 * len(windows)), layout="constrained")
    axes = figure.add_subplot()
    order = sorted(windows, key=lambda row: _first_working(windows[row]))
    for height, row in enumerate(order):
        window = windows[row]
        if not window.times.size:
            continue
        begin, step = window.times[0], np.diff(window.times).min(initial=0.04)
        colours = np.where(window.works, WORKS, FAILS)
        axes.barh(height, step, left=window.times - begin - step / 2.0, height=0.8, color=colours, linewidth=0)
        for number, chosen in enumerate(choices.values()):
            colour = f"C{number}"
            axes.plot(
                chosen[row].time - begin,
                height + 0.5 * ((number + 0.5) / len(choices) - 0.5),
                MARKERS[number % len(MARKERS)],
                color=colour,
                markerfacecolor=colour if chosen[row].success else "white",
                markersize=5,
            )
    for number, name in enumerate(choices):
        axes.plot([], [], MARKERS[number % len(MARKERS)], color=f"C{number}", markersize=5, label=name)
    axes.plot([], [], "o", color="0.4", markerfacecolor="white", markersize=5, label="hollow: it failed")
    axes.barh(0, 0, color=WORKS, label="closing works")
    axes.barh(0, 0, color=FAILS, label="closing fails")
    figure.legend(loc="outside lower center", ncols=6, fontsize=8)
    axes.margins(x=0.02, y=0.01)
    axes.use_sticky_edges = False
    axes.set_yticks(range(len(order)), [f"{row}" for row in order], fontsize=8)
    axes.set(xlabel=f"time since the open hand was {NEAR:g} m from the bottle [s]", ylabel="row", title=title)
    save(figure, file, 150)


def _first_working(window: Window) -> float:
    """The first moment that works, since the first one that was tried [s]; infinite if there is none."""
    return float(window.times[window.works][0] - window.times[0]) if window.works.any() else np.inf
