"""`dextron-bench recordings`: what recordings there are, and recordings as films and tables."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    from dextron_bench.recording import Summary

DIFFERS = 1
COLUMNS = {"method": "method", "reaches": "reaches", "seed": "seed", "split": "split", "row": "row"} | {
    "episode_return": "return",
    "outcome": "outcome",
    "steps": "steps",
}  # Property, and what its column is called.


@dataclass(frozen=True)
class List:
    """List recordings with what they say of themselves; exit code 1, and a line for each, where some are damaged.

    Example: dextron-bench recordings list runs/exp/synthetic/seed0 --check
    """

    place: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN|FILE|DIR ...")] = (
        Path("runs"),
    )
    """Folders of runs or recordings, or single recordings."""
    check: bool = False
    """Read all of every recording, and compare it with its digest and its run's manifest; else only properties are
    read."""
    json: bool = False
    """Print JSON, one object for each recording."""

    def __call__(self) -> int:
        from dextron_bench import recording
        from dextron_bench.runs import selection

        files = selection.recordings(self.place)
        found = list(recording.summarise(files, self.check, selection.hashes(files) if self.check else {}))
        whole = [summary for summary in found if not summary.damage]
        if self.json:
            print_json([_told(summary) for summary in found])
        elif whole:
            told = [_told(summary) for summary in whole]
            cells = [["" if cell is None else cell for cell in list(row.values())[:-1]] for row in told]
            print_table("recordings", list(told[0])[:-1], cells)
        for summary in found:
            if summary.damage:
                print(f"dextron-bench: {summary.file}: {summary.damage}", file=sys.stderr)
        return 0 if len(whole) == len(found) else DIFFERS


@dataclass(frozen=True)
class Export:
    """Write a recording as a film (.mp4, .gif) or as a table with a row for each step (.csv, .parquet).

    Films run in real time unless --speed says otherwise. MP4 needs the extra `video`.

    Example: dextron-bench recordings export runs/exp/synthetic/seed0/recordings/test-0000.rrd --into grasp.gif
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.rrd")]
    """The recording."""
    into: Annotated[Path, tyro.conf.arg(metavar="FILE.{mp4,gif,csv,parquet}")]
    """The file to write."""
    camera: str = "side"
    """Whence a film is seen: behind, front, hand, hero, side or top."""
    width: int = 640
    """Width of a film [pixels]."""
    height: int = 480
    """Height of a film [pixels]."""
    speed: float = 1.0
    """How many times as quick as life a film is."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.recording import export, film

        look = film.FilmStyle(self.width, self.height, self.camera, self.speed)
        with progress_bar("pictures", self.quiet) as progress:
            export.export(self.file, self.into, look, progress)
        print(self.into)
        return 0


def _told(summary: Summary) -> dict[str, Any]:
    told: dict[str, Any] = {"file": str(summary.file)}
    told |= {title: summary.properties.get(name) for name, title in COLUMNS.items()}
    told["outcome"] = "a pair" if "pair" in summary.properties else told["outcome"]
    return told | {"kB": round(summary.size / 1000), "damage": summary.damage}
