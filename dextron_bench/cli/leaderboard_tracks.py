"""`dextron-bench leaderboard tracks`: the baselines of the leaderboard play a split under tracks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from dextron_bench.cli.exit_codes import DONE
from dextron_bench.cli.output import progress_bar
from dextron_bench.reaches.sources import RankedSource


@dataclass(frozen=True)
class Tracks:
    """Let baselines of the leaderboard play a split under tracks, with all their seeds, and build the leaderboard.

    If it is interrupted, the same command continues with the tracks that a row has not played.

    Example: dextron-bench leaderboard tracks --method reflex stopping --reaches real
    """

    method: tuple[str, ...] = ()
    """Only the rows of these methods."""
    track: tuple[str, ...] = ()
    """The tracks, such as delay-100 (docs/splits.md); by default all that a source has."""
    split: str = "test"
    """The split; tracks of the bottle exist for `test` alone."""
    reaches: tuple[RankedSource, ...] = get_args(RankedSource)
    """Only rows on these sources; `real` needs the recorded reaches."""
    board: Path = Path("leaderboard")
    """Folder of the leaderboard."""
    threads: int = 0
    """Threads of the simulation; 0 means one per processor. The results do not depend on it."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import build, track_baselines, verify_board

        for reaches in self.reaches:
            splits = track_baselines.splits_to_play(reaches, self.split, self.track)
            for row in verify_board.rows(self.board, self.method, [reaches]):
                if row.run.episodes.exists():  # A submission, which is played by its author.
                    continue
                missing = track_baselines.missing(row.result, splits)
                with progress_bar(f"{row.name}, tracks", self.quiet) as progress:
                    track_baselines.play(row.run, row.result, missing, self.threads, progress)
                print(f"{row.name}: {len(missing)} of {len(splits)} tracks played now", flush=True)
        print(*build.build(self.board), sep="\n")
        return DONE
