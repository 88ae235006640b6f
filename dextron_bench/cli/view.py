"""`dextron-bench view`: open recordings, those that are there or those of picked episodes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from dextron_bench.cli.output import print_table, progress_bar

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.runs.selection import EpisodeFilter


DIFFERS = 1


@dataclass(frozen=True)
class View:
    """Open recordings in the Rerun viewer, all together; no network is needed.

    As it is, all recordings at the places. With an option that picks (--worst to --row), episodes of the runs there,
    the first five where neither --worst nor --best says how many; what is not recorded yet is played again
    from the actions that were taken, and recorded in its run's folder.

    With --diff two agents are put side by side on the same setting: two recordings, or two runs, of which the first row
    that one solves and the other does not is taken. With --live a policy plays while you watch, on --row of --split.

    Example: dextron-bench view runs/exp/synthetic/seed0

    Example: dextron-bench view --live --method rlil --reaches synthetic

    Example: dextron-bench view --diff runs/bc-quick/real/seed0 runs/rlil-0.1-quick/real/seed0

    Example: dextron-bench view my-agent-synthetic.zip --failed

    Example: dextron-bench view --worst 5 --method rlil-0.1 --reaches real --split unseen-subject --seed 0
    """

    place: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN|FILE|DIR|ZIP ...")] = ()
    """Folders of runs or recordings, single recordings, or submissions; by default the folder of all runs."""
    worst: int | None = None
    """Pick so many episodes with the lowest return."""
    best: int | None = None
    """Pick so many episodes with the highest return."""
    method: tuple[str, ...] = ()
    """Pick among these methods' episodes, called as on the leaderboard."""
    reaches: tuple[Literal["real", "synthetic", "minjerk"], ...] = ()
    """Pick among episodes on these sources of reaches."""
    split: tuple[str, ...] = ()
    """Pick among episodes of these splits."""
    seed: tuple[int, ...] = ()
    """Pick among episodes of agents with these seeds."""
    failed: bool = False
    """Pick among episodes that did not succeed."""
    cause: tuple[str, ...] = ()
    """Pick among episodes that ended so, as in "too late"; docs/diagnosis.md has all causes."""
    row: tuple[int, ...] = ()
    """Pick among these rows of the splits."""
    diff: bool = False
    """Put the two places side by side."""
    live: bool = False
    """Watch the --method, called as on the leaderboard or as in `list`, at work with the weights that ship."""
    speed: float = 1.0
    """How fast it plays, of real time; 0 for at once."""
    runs: Path = Path("runs")
    """Folder of all runs."""
    print: bool = False
    """Print the files, one a line, in place of opening them; needs no screen."""
    quiet: bool = False
    """Show no progress."""

    def __call__(self) -> int:
        from dextron_bench import recording

        if self.live:
            return self._perform()
        places, wish = self._places(), self._wish()
        files = [self._side_by_side(places, wish)] if self.diff else self._found(places, wish)
        whole = _whole(files)
        if self.print:
            print(*whole, sep="\n")
        else:
            recording.view(whole)
        return 0 if len(whole) == len(files) else DIFFERS

    def _places(self) -> list[Path]:
        """Where to look; a submission is unpacked in the folder of runs."""
        from dextron_bench.leaderboard.submission.unpacking import opened

        places = self.place or (self.runs,)
        return [opened(place, self.runs) if place.suffix == ".zip" else place for place in places]

    def _found(self, places: Sequence[Path], wish: EpisodeFilter) -> list[Path]:
        from dextron_bench.runs import selection

        return selection.recordings(places) if wish == selection.EpisodeFilter() else self._picked(places, wish)

    def _side_by_side(self, places: Sequence[Path], wish: EpisodeFilter) -> Path:
        from dextron_bench.runs import selection, side_by_side

        if len(places) != 2:
            raise selection.BadFilter(f"--diff takes two places, recordings or runs; it got {len(self.place)}")
        first, second = places
        return side_by_side.side_by_side(first, second, wish, self.runs)

    def _perform(self) -> int:
        from dextron_bench import recording
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.runs import selection
        from dextron_bench.splits.loading import load_split
        from dextron_bench.success import live as success_live
        from dextron_bench.success import network

        if len(self.method) != 1:
            raise selection.BadFilter("--live takes one --method, such as rlil or exp")
        if not 0.0 <= self.speed < float("inf"):
            raise selection.BadFilter(f"--speed {self.speed:g}: it plays so many times as fast as life, or 0: at once")
        reaches = self.reaches[0] if self.reaches else "synthetic"
        label, agent = weights.agent_by_name(self.method[0], reaches, self.seed[0] if self.seed else 0)
        split = load_split(reaches, self.split[0] if self.split else "test")
        model, source = network.shipped_model(reaches), open_source(reaches)
        cases = {row: split.case(row) for row in self.row or (0,)}
        with recording.open_live_viewer() as (connect, wait):
            for row, case in cases.items():
                about = {"method": label, "reaches": reaches, "split": split.name, "row": row}
                stage = recording.LiveView(connect, f"{label}, {split.name} {row}", source.path(case.setting), about)
                episode = success_live.play(agent, source, case, model, stage, self.speed)
                print(f"{label} on row {row} of {split.name}: {episode.score:g} of 20")
            wait()
        return 0

    def _wish(self) -> EpisodeFilter:
        from dextron_bench.runs.selection import EpisodeFilter

        return EpisodeFilter(**{name: getattr(self, name) for name in EpisodeFilter.__slots__})

    def _picked(self, places: Sequence[Path], wish: EpisodeFilter) -> list[Path]:
        """The recordings of picked episodes; what they are is told, where no program reads it."""
        from dextron_bench.runs import rerecording, selection

        picked, matching = selection.select(selection.episodes(places), wish)
        with progress_bar("recordings", self.quiet) as progress:
            files = rerecording.rerecord(picked, progress)
        if not self.print:
            _tell(picked)
        if len(picked) < matching and wish.worst is None and wish.best is None:
            told = (
                f"{matching} episodes are as asked for, these are the first {len(picked)}; --worst {matching} takes all"
            )
            print(f"dextron-bench: {told}", file=sys.stderr)
        return files


def _whole(files: Sequence[Path]) -> list[Path]:
    """The recordings that can be trusted; of the others a line each tells why not. Raises NoEpisodes."""
    from dextron_bench import recording
    from dextron_bench.runs import selection

    found = list(recording.summarise(files, whole=True, hashes=selection.hashes(files)))
    damaged = [f"{summary.file}: {summary.damage}" for summary in found if summary.damage]
    if len(damaged) == len(found):
        raise selection.NoEpisodes("; ".join(damaged))
    for line in damaged:
        print(f"dextron-bench: {line}", file=sys.stderr)
    return [summary.file for summary in found if not summary.damage]


def _tell(picked: pd.DataFrame) -> None:
    columns = ["method", "reaches", "seed", "split", "row", "score", "length", "cause"]
    named = [{"score": "return", "length": "steps"}.get(column, column) for column in columns]
    print_table("episodes", named, picked[columns].itertuples(index=False))
