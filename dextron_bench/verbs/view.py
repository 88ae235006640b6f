"""`dextron-bench view`: open recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


class NothingToView(ValueError):
    """A place without recordings."""


@dataclass(frozen=True)
class View:
    """Open the recordings of a run, or recording files, in the Rerun viewer; no network is needed.

    Example: dextron-bench view runs/exp/synthetic/seed0
    """

    place: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN|FILE")]
    """A run's folder, or one recording."""

    def __call__(self) -> int:
        from dextron_bench import recording

        recording.view(recordings(self.place))
        return 0


def recordings(place: Path) -> list[Path]:
    """The recordings at a place; raises NothingToView."""
    found = [place] if place.is_file() else sorted(place.glob("**/*.rrd"))
    if not found:
        raise NothingToView(f"no recordings at {place}; make some with `dextron-bench run --record 3`")
    return found
