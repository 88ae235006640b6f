"""`dextron-bench recordings list` and `export`: lists recordings and writes them as films and tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.support.episode_flags import EpisodeFlags
from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_json, print_table, print_warning, progress_bar

if TYPE_CHECKING:
    from dextron_bench.recording import Summary

COLUMNS = {"method": "method", "reaches": "reaches", "seed": "seed", "split": "split", "row": "row"} | {
    "episode_return": "return",
    "outcome": "outcome",
    "steps": "steps",
}  # The title of each property's column.


@dataclass(frozen=True)
class List(EpisodeFlags):
    """List recordings with their properties. If some are damaged, print a line for each and exit with code 1.

    Example: dextron-bench recordings list runs/exp/synthetic/seed0 --check

    Example: dextron-bench recordings list --method reflex --cause "too late" --worst 5
    """

    place: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN|FILE|DIR ...")] = (
        Path("runs"),
    )
    """Folders of runs or recordings, or single recordings."""
    check: bool = False
    """Compare the content of each recording with its digest and its run's manifest; default: read properties only."""
    json: bool = False
    """Print JSON, one object for each recording."""

    def __call__(self) -> int:
        from dextron_bench import recording
        from dextron_bench.catalogue import selection

        files = selection.recordings(self.place)
        summaries = list(recording.summarise(files, self.check, selection.hashes(files) if self.check else {}))
        damaged = [summary for summary in summaries if summary.damage]
        shown = self._selected([summary for summary in summaries if not summary.damage])
        if self.json:
            print_json([_row(summary) for summary in [*shown, *damaged]])
        elif shown:
            rows = [_row(summary) for summary in shown]
            cells = [["" if cell is None else cell for cell in list(row.values())[:-1]] for row in rows]
            print_table("recordings", list(rows[0])[:-1], cells)
        elif not damaged:
            print(f"none of {len(files)} recordings passes the filter")
        for summary in damaged:
            print_warning(f"{summary.file}: {summary.damage}")
        return DIFFERS if damaged else DONE

    def _selected(self, undamaged: list[Summary]) -> list[Summary]:
        from dextron_bench.catalogue import episodes, selection

        if (episode_filter := self.episode_filter()) == selection.EpisodeFilter():
            return undamaged
        table = selection.matching(episodes.of_recordings(undamaged), episode_filter)
        return [undamaged[place] for place in selection.best_and_worst(table, episode_filter).index]


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
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.recording import export, film

        look = film.FilmStyle(self.width, self.height, self.camera, self.speed, not self.plain)
        with progress_bar("pictures", self.quiet) as progress:
            export.export(self.file, self.into, look, progress)
        print(self.into)
        return DONE


def _row(summary: Summary) -> dict[str, Any]:
    from dextron_bench.catalogue import episodes

    row: dict[str, Any] = {"file": str(summary.file)}
    row |= {title: summary.properties.get(name) for name, title in COLUMNS.items()}
    is_pair = "pair" in summary.properties
    row["outcome"] = "a pair" if is_pair else row["outcome"]
    row["cause"] = None if is_pair or summary.damage else episodes.cause(summary)
    return row | {"kB": round(summary.size / 1000), "damage": summary.damage}
