"""`dextron-bench view`: opens existing recordings, or recordings of selected episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dextron_bench.cli.support import flags
from dextron_bench.cli.support.episode_flags import EpisodeFlags
from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_table, print_warning, progress_bar
from dextron_bench.cli.support.serving import serve

if TYPE_CHECKING:
    import pandas as pd

    from dextron_bench.catalogue.selection import EpisodeFilter


@dataclass(frozen=True)
class View(EpisodeFlags):
    """Open recordings together in one window of Rerun's viewer, or in the browser; no network is needed.

    By default the command opens all recordings at the given places. The options --worst to --row select episodes of
    the runs at these places instead; without --worst or --best, the first five. Episodes without a recording are
    replayed from their actions and recorded in the folder of their run.

    With --diff, two agents appear side by side on the same setting: two recordings, or two runs on the first row that
    only one of them solves. With --live and a place, the window follows the trainings there, running or finished:
    curves, and the newest episodes of each seed. With --live and --method, a policy plays --row of --split.

    --web serves the recordings on this machine only, until Ctrl-C. On another machine, forward the port:
    ssh -L 8767:127.0.0.1:8767 HOST.

    Example: dextron-bench view runs/exp/synthetic/seed0

    Example: dextron-bench view --live runs/rlil-0.1/synthetic

    Example: dextron-bench view --live --method rlil --reaches synthetic

    Example: dextron-bench view --diff runs/bc-quick/real/seed0 runs/rlil-0.1-quick/real/seed0

    Example: dextron-bench view my-agent-synthetic.zip --failed --web

    Example: dextron-bench view --worst 5 --method rlil-0.1 --reaches real --split unseen-subject --seed 0
    """

    place: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN|FILE|DIR|ZIP ...")] = ()
    """Folders of runs or recordings, single recordings, or submissions; by default the folder of all runs."""
    diff: bool = False
    """Show two places side by side."""
    live: bool = False
    """Follow a training, or watch --method play: a method's name, file.py:Class, or a label with shipped weights."""
    speed: float = 1.0
    """Speed of --live, as a multiple of real time; 0 means without delay."""
    runs: flags.Runs = flags.RUNS
    web: bool = False
    """Open the recordings in the browser; no screen and no GPU is needed here."""
    port: int = 8767
    """With --web: the port on 127.0.0.1; 0 takes a free one."""
    print: bool = False
    """Print the names of the files, one in each line, instead of opening them; works without a display."""
    quiet: flags.Quiet = False

    def __call__(self) -> int:
        from dextron_bench import recording

        if self.live:
            return self._live()
        places, episode_filter = self._places(), self.episode_filter()
        files = [self._side_by_side(places, episode_filter)] if self.diff else self._recordings(places, episode_filter)
        undamaged = _undamaged(files)
        if self.print:
            print(*undamaged, sep="\n")
        elif self.web:
            self._serve(undamaged)
        else:
            recording.view(undamaged)
        return DONE if len(undamaged) == len(files) else DIFFERS

    def _places(self) -> list[Path]:
        """The places of recordings; a submission is unpacked in the folder of runs."""
        from dextron_bench.submissions.unpacking import unpack_for_viewing

        places = self.place or (self.runs,)
        return [unpack_for_viewing(place, self.runs) if place.suffix == ".zip" else place for place in places]

    def _recordings(self, places: Sequence[Path], episode_filter: EpisodeFilter) -> list[Path]:
        from dextron_bench.catalogue import selection

        if episode_filter == selection.EpisodeFilter():
            return selection.recordings(places)
        return self._select(places, episode_filter)

    def _side_by_side(self, places: Sequence[Path], episode_filter: EpisodeFilter) -> Path:
        from dextron_bench.catalogue import selection, side_by_side

        if len(places) != 2:
            raise selection.BadFilter(f"--diff takes two places, recordings or runs; there are {len(self.place)}")
        first, second = places
        return side_by_side.side_by_side(first, second, episode_filter, self.runs)

    def _serve(self, files: Sequence[Path]) -> None:
        from dextron_bench.recording import web_viewer_files
        from dextron_bench.web.local_server import LocalServer
        from dextron_bench.web.viewer_site import ViewerSite

        with LocalServer(ViewerSite(files, web_viewer_files()), self.port) as server:
            serve(server)

    def _live(self) -> int:
        from dextron_bench.catalogue.selection import BadFilter

        if self.web:
            raise BadFilter("--live shows its window on a screen; `run --tracker tensorboard` follows in the browser")
        return self._follow_training() if self.place else self._play_live()

    def _follow_training(self) -> int:
        """Shows the trainings at the places until the user closes the window."""
        from dextron_bench.tracking import live
        from dextron_bench.tracking.training_files import TrainingFiles, training_folders

        folders = {folder: seeds for place in self.place for folder, seeds in training_folders(place).items()}
        trainings = [TrainingFiles(folder, seeds) for folder, seeds in folders.items()]
        counts = live.watch(trainings, lambda: all(files.is_over for files in trainings))
        lost = f"; {counts.dropped} could not be shown ({counts.error})" if counts.dropped else ""
        print(f"{', '.join(files.name for files in trainings)}: {counts.points} points shown{lost}")
        return DONE

    def _play_live(self) -> int:
        from dextron_bench import recording
        from dextron_bench.methods import weights
        from dextron_bench.reaches.sources import open_source
        from dextron_bench.splits.loading import load_split
        from dextron_bench.success import live as success_live
        from dextron_bench.success import network

        self._check_live()
        reaches = self.reaches[0] if self.reaches else "synthetic"
        label, agent = weights.agent_by_name(self.method[0], reaches, self.seed[0] if self.seed else 0)
        split = load_split(reaches, self.split[0] if self.split else "test")
        model, source = network.shipped_model(reaches), open_source(reaches)
        rows = {row: split.rows([row]) for row in self.row or (0,)}
        with recording.open_live_viewer() as (connect, wait):
            for row, played in rows.items():
                properties = {"method": label, "reaches": reaches, "split": split.name, "row": row}
                title = f"{label}, {split.name} {row}"
                observer = recording.LiveView(connect, title, source.path(split.case(row).setting), properties)
                episode = success_live.play(agent, source, played, model, observer, self.speed)
                print(f"{label} on row {row} of {split.name}: {episode.score:g} of 20")
            wait()
        return DONE

    def _check_live(self) -> None:
        from dextron_bench.catalogue.selection import BadFilter

        if len(self.method) != 1:
            raise BadFilter("--live takes the folder of a training, or one --method, such as rlil or exp")

    def _select(self, places: Sequence[Path], episode_filter: EpisodeFilter) -> list[Path]:
        """The recordings of selected episodes; prints a table of them unless --print is set."""
        from dextron_bench.catalogue import episodes, rerecording, selection

        table, matching = selection.select(episodes.read(places), episode_filter)
        with progress_bar("recordings", self.quiet) as progress:
            files = rerecording.rerecord(table, progress)
        if not self.print:
            _print_episodes(table)
        if len(table) < matching and episode_filter.worst is None and episode_filter.best is None:
            print_warning(
                f"{matching} episodes match; these are the first {len(table)}, --worst {matching} selects all"
            )
        return files


def _undamaged(files: Sequence[Path]) -> list[Path]:
    """The undamaged recordings; prints a line on stderr for each damaged one. Raises NoEpisodes if all are damaged."""
    from dextron_bench import recording
    from dextron_bench.catalogue import episodes, selection

    summaries = list(recording.summarise(files, whole=True, hashes=selection.hashes(files)))
    damaged = [f"{summary.file}: {summary.damage}" for summary in summaries if summary.damage]
    if len(damaged) == len(summaries):
        raise episodes.NoEpisodes("; ".join(damaged))
    for fault in damaged:
        print_warning(fault)
    return [summary.file for summary in summaries if not summary.damage]


def _print_episodes(table: pd.DataFrame) -> None:
    columns = ["method", "reaches", "seed", "split", "row", "return", "steps", "cause"]
    print_table("episodes", columns, table[columns].itertuples(index=False))
