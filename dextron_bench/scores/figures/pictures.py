"""Files of pictures: their formats, and how they are written. Equal figures give equal bytes in every format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib import rc_context, rcdefaults
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox, BboxBase

from dextron_bench.errors import BadInput
from dextron_bench.storage import atomic

FORMATS = (".pdf", ".png", ".svg")
DATES = {".pdf": "CreationDate", ".svg": "Date"}  # Left out, so that equal figures have equal bytes.
PLACES = 5  # Decimals of the places of axes, in shares of the figure.
INK = "#010203"  # The page replaces this colour with the colour of its text.
INLINE: Any = {  # For pictures inside the page: text stays text, and the background is transparent.
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
    "svg.fonttype": "none",
    "savefig.transparent": True,
    "legend.frameon": False,
    "text.parse_math": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
}
rcdefaults()  # A file `matplotlibrc` in the working folder, or of the user, changes no picture.


class UnknownFormat(BadInput):
    """The suffix of a picture's file names no supported format."""

    def __init__(self, file: Path) -> None:
        super().__init__(f"{file}: no picture format {file.suffix!r}; choose from {', '.join(FORMATS)}")


def check_format(file: Path) -> None:
    """Raises UnknownFormat for a file whose suffix names no supported format."""
    if file.suffix.lower() not in FORMATS:
        raise UnknownFormat(file)


def inline(draw: Callable[[Path], None]) -> str:
    """The SVG that `draw` saves to a file, for use inside the page. The page replaces INK and black."""
    with TemporaryDirectory() as folder, rc_context(INLINE):
        file = Path(folder) / "picture.svg"
        draw(file)
        return file.read_text(encoding="utf-8")


def save(figure: Figure, file: Path, dpi: int) -> None:
    """Writes a figure atomically; equal figures give equal bytes. The layout of the figure is fixed from then on."""
    _lay_out(figure, dpi)
    suffix = file.suffix.lower()
    metadata: Any = {DATES[suffix]: None} if suffix in DATES else None

    def write(part: Path) -> None:
        figure.savefig(part, dpi=dpi, metadata=metadata, format=suffix.removeprefix("."))

    with rc_context({"svg.hashsalt": "dextron-bench"}):
        atomic.write_atomically(file, write)


def _lay_out(figure: Figure, dpi: int) -> None:
    """Lays a figure out and rounds the places of its parts: the last bits of the solver depend on memory addresses."""
    figure.set_dpi(dpi)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for part in figure.subfigs:
        part.bbox_relative.set_points(_rounded(part.bbox_relative))
    for axes in figure.axes:
        axes.set_position(Bbox(_rounded(axes.get_position(original=True))))


def _rounded(box: BboxBase) -> np.ndarray:
    """The corners (2, 2) of a box in shares of a figure, to less than a pixel."""
    return np.round(box.get_points(), PLACES)
