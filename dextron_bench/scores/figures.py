"""Draws the paper's figures and the page's pictures. Equal figures give equal bytes in every format.

Longer than other modules, since it is the only one that imports matplotlib.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib import colormaps, rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d import Axes3D

from dextron_bench.reaches.setting import Setting, Source, Stratum, from_frame
from dextron_bench.scores.paired import SIGNIFICANT
from dextron_bench.storage import atomic

if TYPE_CHECKING:
    from dextron_bench.scores.comparison import Comparison
    from dextron_bench.success.exemplars import PredictedEpisode

RIDGES = 40  # About how many curves an episode gets.
FORMATS = (".pdf", ".png", ".svg")
HUES = ("Blues", "Oranges", "Greens", "Greys")  # One for each angle; farther rings are darker.
BETTER, WORSE = "tab:blue", "tab:orange"
DATES = {".pdf": "CreationDate", ".svg": "Date"}  # Left out, so that equal figures have equal bytes.
INK = "#010203"  # The page replaces this colour with the colour of its text.
INLINE: Any = {  # For pictures inside the page: text stays text, and the background is transparent.
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
    **{"svg.fonttype": "none", "savefig.transparent": True, "legend.frameon": False, "text.parse_math": False},
    **{"axes.spines.top": False, "axes.spines.right": False},
}
BOTTLE_RADIUS, BOTTLE_HEIGHT = 0.025, 0.25  # [m]


class UnknownFormat(ValueError):
    """The suffix of a picture's file names no supported format."""

    def __init__(self, file: Path) -> None:
        super().__init__(f"{file}: no picture format {file.suffix!r}; choose from {', '.join(FORMATS)}")


def reach_paths(source: Source, file: Path) -> None:
    """Draws all reaches of a source around the bottle in 3D, coloured by start region (paper, Fig. 3b).

    The reaches have no offset and no duration noise. Raises UnknownFormat, OSError.
    """
    _check_format(file)
    figure = Figure(figsize=(7, 6), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    labelled: set[tuple[int, int]] = set()
    for name in source.names:
        stratum = source.stratum(name)
        region = (stratum.angle, stratum.ring)
        label = None if region in labelled else f"angle {stratum.angle}, ring {stratum.ring}"
        labelled.add(region)
        x, y, z = source.path(Setting(name, 0.0, 0.0, 0.0)).positions.T
        axes.plot(x, y, z, color=_colour(stratum), linewidth=0.5, label=label)
    _bottle(axes)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=f"{len(source.names)} {source.name} reaches")
    axes.set_aspect("equal")
    handles, labels = axes.get_legend_handles_labels()
    order = np.argsort(labels)
    axes.legend([handles[i] for i in order], [labels[i] for i in order], fontsize=6, ncols=4, loc="upper center")
    _save(figure, file, 200)


def start_points(source: Source, rows: pd.DataFrame, file: Path) -> None:
    """Draws the start of the palm's carrier in each setting of a table, seen from above (paper, Fig. 3a).

    `rows` has the columns of a setting. Each row is one point, coloured by its start region. Raises UnknownFormat,
    OSError.
    """
    _check_format(file)
    settings = from_frame(rows)
    starts = np.array([source.path(setting).positions[0, :2] for setting in settings]).reshape(-1, 2)
    colours = [_colour(source.stratum(setting.reach)) for setting in settings]
    figure = Figure(figsize=(6, 6.5), layout="constrained")
    axes = figure.add_subplot()
    axes.scatter(*starts.T, s=3, c=colours, linewidths=0)
    axes.add_patch(Circle((0.0, 0.0), BOTTLE_RADIUS, color="tab:red", alpha=0.6))
    for angle, hue in enumerate(HUES):
        axes.scatter([], [], s=12, color=colormaps[hue](0.7), label=f"angle {angle}")
    figure.legend(title="start regions; darker is farther", loc="outside lower center", ncols=len(HUES))
    axes.set(xlabel="x [m]", ylabel="y [m]", title=f"Starts of {len(rows)} solved {source.name} settings")
    axes.set_aspect("equal")
    _save(figure, file, 200)


def learning_curves(
    curves: dict[str, dict[int, pd.DataFrame]], rows: pd.DataFrame, file: Path, epochs: str = "epochs of 1,000 frames"
) -> None:
    """Draws mean and range over seeds of the return on `val` against epochs (paper, Fig. 4a and 4c).

    `curves` has a table for each method and seed, with columns `epoch` and `return`. A method in the leaderboard's
    `rows` without curves is a line at its return on `test`. `epochs` is the label of the axis. Raises UnknownFormat,
    OSError.
    """
    _check_format(file)
    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.add_subplot()
    for index, (label, seeds) in enumerate(sorted(curves.items())):
        table = pd.concat([points.set_index("epoch")["return"] for points in seeds.values()], axis=1)
        mean, colour = table.mean(axis=1), f"C{index}"
        axes.plot(table.index, mean, color=colour, label=f"{label} ({len(seeds)} seeds)", linewidth=1.5)
        axes.fill_between(table.index, table.min(axis=1), table.max(axis=1), color=colour, alpha=0.15, linewidth=0)
    constant = rows[(rows["split"] == "test") & ~rows["method"].isin(list(curves))]
    for index, row in enumerate(constant.to_dict("records"), start=len(curves)):
        style = ("--", ":", "-.")[index % 3]
        axes.axhline(row["return"], color=f"C{index}", linewidth=1, linestyle=style, label=f"{row['method']} (on test)")
    axes.set(xlabel=epochs, ylabel="sum of rewards", ylim=(0.0, 20.5), xlim=(0.0, None))
    axes.set_title("Mean and range over seeds on 50 settings of val")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    _save(figure, file, 150)


def success_curve(points: list[dict[str, float]], file: Path) -> None:
    """Draws loss and accuracy of the success model on training and held-out episodes against epochs (paper, Fig. 4b).

    Raises UnknownFormat, OSError.
    """
    _check_format(file)
    figure = Figure(figsize=(8, 3.5), layout="constrained")
    table = pd.DataFrame(points).set_index("epoch")
    for axes, name in zip(figure.subplots(1, 2), ("loss", "accuracy"), strict=True):
        axes.plot(table.index, table[name], label="episodes learned from")
        axes.plot(table.index, table[f"test_{name}"], label="episodes held out")
        axes.set(xlabel="epoch", ylabel="cross entropy" if name == "loss" else name)
        axes.legend(fontsize=8)
    _save(figure, file, 150)


def ridges(episodes: dict[str, PredictedEpisode], file: Path) -> None:
    """Draws the success that the model predicts for every action, with about RIDGES curves an episode (paper, Fig. 5).

    `episodes` are named by their titles. Time increases upwards, as a share of the reach. A tick marks the chosen
    action. Curves that predict the outcome correctly are green, others are red. Raises UnknownFormat, OSError.
    """
    _check_format(file)
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
    _save(figure, file, 150)


def differences(comparison: Comparison, file: Path) -> None:
    """Draws how much more B scores than A: mean and interval of each group, and all settings in order of difference.

    Blue means better, orange worse, grey not significant after Holm's correction. Raises UnknownFormat, OSError.
    """
    _check_format(file)
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
    _save(figure, file, 150)


def inline(draw: Callable[[Path], None]) -> str:
    """The SVG that `draw` saves to a file, for use inside the page. The page replaces INK and black."""
    with TemporaryDirectory() as folder, rc_context(INLINE):
        file = Path(folder) / "picture.svg"
        draw(file)
        return file.read_text(encoding="utf-8")


def _save(figure: Figure, file: Path, dpi: int) -> None:
    """Writes a figure atomically; equal figures give equal bytes."""
    suffix = file.suffix.lower()
    metadata: Any = {DATES[suffix]: None} if suffix in DATES else None

    def write(part: Path) -> None:
        figure.savefig(part, dpi=dpi, metadata=metadata, format=suffix.removeprefix("."))

    with rc_context({"svg.hashsalt": "dextron-bench"}):
        atomic.write_atomically(file, write)


def _check_format(file: Path) -> None:
    if file.suffix.lower() not in FORMATS:
        raise UnknownFormat(file)


def _colour(stratum: Stratum) -> tuple[float, float, float, float]:
    return colormaps[HUES[stratum.angle]](0.4 + 0.2 * stratum.ring)


def _bottle(axes: Axes3D) -> None:
    angles, height = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 24), [0.0, BOTTLE_HEIGHT])
    x, y = BOTTLE_RADIUS * np.cos(angles), BOTTLE_RADIUS * np.sin(angles)
    axes.plot_surface(x, y, height, color="tab:red", alpha=0.4)
