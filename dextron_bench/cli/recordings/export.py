"""`dextron-bench recordings export`: writes a recording as a film or a table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import progress_bar


@dataclass(frozen=True)
class Export:
    """Write a recording as a film (.mp4, .gif) or as a table with a row for each step (.csv, .parquet).

    Films run in real time by default. MP4 needs the extra `video`.

    Example: dextron-bench recordings export runs/exp/synthetic/seed0/recordings/test-0000.rrd --into grasp.gif
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.rrd")]
    """The recording."""
    into: Annotated[Path, tyro.conf.arg(metavar="FILE.{mp4,gif,csv,parquet}")]
    """The file to write."""
    camera: str = "side"
    """The camera of a film: behind, follow (near the hand, moves with it), front, hand, hero, side or top."""
    width: int = 640
    """Width of a film [pixels]."""
    height: int = 480
    """Height of a film [pixels]."""
    speed: float = 1.0
    """Speed of a film, as a multiple of real time."""
    plain: bool = False
    """No numbers in the picture of a film."""
    quiet: flags.Quiet = False

    def __call__(self) -> int:
        from dextron_bench.recording import export, film

        look = film.FilmStyle(self.width, self.height, self.camera, self.speed, not self.plain)
        with progress_bar("pictures", self.quiet) as progress:
            export.export(self.file, self.into, look, progress)
        print(self.into)
        return DONE
