"""Pictures of reaches and of where they start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d import Axes3D

from dextron_bench.reaches.setting import Setting, Source, Stratum, from_frame
from dextron_bench.scores.figures.pictures import check_format, save

HUES = ("Blues", "Oranges", "Greens", "Greys")  # One for each angle; farther rings are darker.
BOTTLE_RADIUS, BOTTLE_HEIGHT = 0.025, 0.25  # [m]


def reach_paths(source: Source, file: Path) -> None:
    """Draws all reaches of a source around the bottle in 3D, coloured by start region (paper, Fig. 3b).

    The reaches have no offset and no duration noise. Raises UnknownFormat, OSError.
    """
    check_format(file)
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
    save(figure, file, 200)


def start_points(source: Source, rows: pd.DataFrame, file: Path) -> None:
    """Draws the start of the palm's carrier in each setting of a table, seen from above (paper, Fig. 3a).

    `rows` has the columns of a setting. Each row is one point, coloured by its start region. Raises UnknownFormat,
    OSError.
    """
    check_format(file)
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
    save(figure, file, 200)


def _colour(stratum: Stratum) -> tuple[float, float, float, float]:
    return colormaps[HUES[stratum.angle]](0.4 + 0.2 * stratum.ring)


def _bottle(axes: Axes3D) -> None:
    angles, height = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 24), [0.0, BOTTLE_HEIGHT])
    x, y = BOTTLE_RADIUS * np.cos(angles), BOTTLE_RADIUS * np.sin(angles)
    axes.plot_surface(x, y, height, color="tab:red", alpha=0.4)
