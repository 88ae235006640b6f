"""The episodes of a round, in pieces (`storage/pieces.py`): a piece is what one seed of a row plays."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.evaluation.episodes import Episode, action_hashes
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.leaderboard import collect, round_entries, rounds
from dextron_bench.leaderboard.baseline_check import agents_of
from dextron_bench.leaderboard.board_rows import Row
from dextron_bench.leaderboard.rounds import Round
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.reaches import sources
from dextron_bench.runs import result_files
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, hashing, records, tables
from dextron_bench.storage.atomic import Json
from dextron_bench.storage.folders import visible
from dextron_bench.storage.pieces import ListedWork, Place, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.storage.tables import counts, finite, flags, returns, texts
from dextron_bench.submissions import bundle, playing, relaunch
from dextron_bench.submissions.manifest import Manifest
from dextron_bench.world import model

FILE = ".parquet"  # Ending of the file of a piece, beside its stamp.
BOARD = "board"  # Folder below the runs of another process, with the files of the row and of the round.
ROUND: tables.Columns = {  # The columns of a round's episodes.
    **dict.fromkeys(("method", "reaches", "split", "actions"), texts),
    "seed": counts,
    "row": counts,
    "score": returns,
    "repeats": flags,
    "seconds": finite,
}


@dataclass(frozen=True)
class RoundWork(ListedWork):
    """What the rows of a round play, in the folder `place`."""

    place: Path
    round: Round
    rows: Sequence[Row]
    threads: int = 0

    def names(self) -> list[str]:
        """The names of all pieces, in the order of the rows."""
        return list(self._rows())

    def title(self, name: str) -> str:
        """The run of a row: method, source of reaches and seed."""
        return self._rows()[name].run.identity

    def config_of(self, name: str) -> dict[str, Json] | None:
        """What the episodes of a piece depend on: what was announced and drawn."""
        if name not in self._rows():
            return None
        return {"physics": model.mjcf_hash(), "drawn": hashing.sha256(self.round.draw_file)}

    def recipe(self, name: str) -> Recipe:
        """How another process plays the row of a piece."""
        row = self._rows()[name]
        places = (row.run.path.parent, self.round.folder)
        files = [file for place in places for file in visible(place, "**/*") if file.is_file()]
        inputs = {f"{BOARD}/{file.relative_to(self.round.board).as_posix()}": file for file in files}
        again = partial(_play_again, identity=row.run.identity, number=self.round.number)
        return Recipe(again, row.result.reaches, inputs)

    def play(self, name: str, report: Progress = no_progress) -> list[Path]:
        """Lets a seed of a row play all settings of its source; returns the files, the stamp last.

        Raises AgentError, BadBundle, NotReproducible.
        """
        table = play_row(self._rows()[name], self.round.splits(self._rows()[name].result.reaches), self.threads, report)
        tables.write(file := self.file(name, FILE), table)
        return self.complete(name, [file])

    def finish(self) -> None:
        """Writes the table of all episodes, whose pieces are all there, and removes the pieces; raises DamagedFile."""
        stored = self.stored()
        parts = [tables.read_own(self.file(name, FILE), ROUND) for name in self.names()]
        tables.write(self.round.episodes_file, pd.concat(parts, ignore_index=True), compression="zstd")
        self.remove(stored.values())

    def _rows(self) -> dict[str, Row]:
        """The rows by the names of their pieces."""
        return {row.run.identity.replace("/", "-"): row for row in self.rows}


def work(round_: Round, runs: Path, threads: int = 0) -> RoundWork:
    """The work of a round, below a folder of runs; raises BadInput if a row was changed since it was announced."""
    rows = round_entries.announced(round_.board, round_.number, round_.commitments.entries)
    return RoundWork(runs / rounds.FOLDER / str(round_.number), round_, rows, threads)


def play_row(row: Row, splits: Sequence[Split], threads: int, report: Progress) -> pd.DataFrame:
    """The episodes of a row on fresh splits: the columns ROUND.

    A submission plays the first split twice: `repeats` is false if it then acts differently. `seconds` is how long the
    seed has played.
    """
    started, parts, total = time.monotonic(), [], sum(map(len, splits))
    for split in splits:
        episodes = row_episodes(row, split, threads)
        parts.append(episodes)
        report(sum(map(len, parts)), total)
    seconds = time.monotonic() - started
    repeats = not row.run.episodes.exists() or row_episodes(row, splits[0], threads).equals(parts[0])
    about = {"method": row.result.method, "reaches": row.result.reaches, "seed": row.result.seed}
    return pd.concat(parts, ignore_index=True).assign(**about, repeats=repeats, seconds=round(seconds, 1))


def read_episodes(round_: Round) -> pd.DataFrame:
    """The episodes of a round that is over, the columns ROUND; raises DamagedFile if a seed lacks some."""
    table = tables.read_own(file := round_.episodes_file, ROUND)
    settings = {
        reaches: [(split.name, row) for split in round_.splits(reaches) for row in range(len(split))]
        for reaches in set(table["reaches"])
    }
    for (method, reaches, seed), part in table.groupby(["method", "reaches", "seed"]):
        if list(zip(part["split"], part["row"], strict=True)) != settings[str(reaches)]:
            raise atomic.OtherForm(file, f"episodes of {method}/{reaches}, seed {seed}, do not fit its settings")
    return table


def row_episodes(row: Row, split: Split, threads: int) -> pd.DataFrame:
    """Row, score and hash of the actions of each episode of a split, in order."""
    played = dict(_play(row, split, threads))
    episodes = [played[index] for index in range(len(split))]
    actions = action_hashes([episode.actions[:, 0] for episode in episodes])
    scores = [episode.score for episode in episodes]
    return pd.DataFrame({"split": split.name, "row": np.arange(len(split)), "score": scores, "actions": actions})


def _play(row: Row, split: Split, threads: int) -> Iterator[tuple[int, Episode]]:
    """Plays a split with the agent of a baseline, or of a submission in the sandbox."""
    source = sources.open_source(split.reaches)
    if not row.run.episodes.exists():
        return rollout(agents_of(row.run, row.result)(), source, split, threads=threads)
    place = row.run.path.parent
    launch = relaunch.launch_of(records.read(place / bundle.MANIFEST, Manifest).agent, place / bundle.AGENT)
    return playing.play_shuffled(launch, source, split, row.result.seed, Limits(), threads)


def _play_again(place: Place, identity: str, number: int) -> RoundWork:
    """The work on a row whose files another process has put below the folder of runs."""
    board = place.runs / BOARD
    run = RunFolder(board / collect.RESULTS / identity)
    row = Row(run, result_files.read_result(run.result))
    return RoundWork(place.folder, Round(board, number), [row], place.threads)
