"""`dextron-bench leaderboard tracks`: the baselines of the leaderboard play a split under tracks."""

from __future__ import annotations

from dataclasses import dataclass

from dextron_bench.cli.support.baseline_flags import BaselineFlags
from dextron_bench.cli.support.exit_codes import DONE
from dextron_bench.cli.support.output import progress_bar


@dataclass(frozen=True)
class Tracks(BaselineFlags):
    """Let baselines of the leaderboard play a split under tracks, with all their seeds, and build the leaderboard.

    If it is interrupted, the same command continues with the tracks that a row has not played.

    Example: dextron-bench leaderboard tracks --method reflex stopping --reaches real
    """

    track: tuple[str, ...] = ()
    """The tracks, such as delay-100 (docs/splits.md); by default all that a source has."""
    split: str = "test"
    """The split; tracks of the bottle exist for `test` alone."""

    def __call__(self) -> int:
        from dextron_bench.leaderboard import build, track_baselines

        for reaches, rows in self.baselines().items():
            splits = track_baselines.splits_to_play(reaches, self.split, self.track)
            for row in rows:
                missing = track_baselines.missing(row.result, splits)
                with progress_bar(f"{row.name}, tracks", self.quiet) as progress:
                    track_baselines.play(row.run, row.result, missing, self.threads, progress)
                print(f"{row.name}: {len(missing)} of {len(splits)} tracks played now", flush=True)
        print(*build.build(self.board), sep="\n")
        return DONE
