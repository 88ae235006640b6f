"""`dextron-bench recordings list`: recordings with their properties."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from dextron_bench.cli.support.episode_flags import EpisodeFlags
from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_json, print_table, print_warning

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


def _row(summary: Summary) -> dict[str, Any]:
    from dextron_bench.catalogue import episodes

    row: dict[str, Any] = {"file": str(summary.file)}
    row |= {title: summary.properties.get(name) for name, title in COLUMNS.items()}
    is_pair = "pair" in summary.properties
    row["outcome"] = "a pair" if is_pair else row["outcome"]
    row["cause"] = None if is_pair or summary.damage else episodes.cause(summary)
    return row | {"kB": round(summary.size / 1000), "damage": summary.damage}
