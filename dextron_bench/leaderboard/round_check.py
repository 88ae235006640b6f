"""Verifies a round: its files belong together, its settings follow from its beacon, and rows play it again."""

from __future__ import annotations

import numpy as np
import pandas as pd

from dextron_bench.evaluation.episodes import action_hashes
from dextron_bench.experts import montecarlo
from dextron_bench.leaderboard.baseline_check import agents_of, drawn_rows, play_rows
from dextron_bench.leaderboard.board_rows import Row
from dextron_bench.leaderboard.round_work import read_episodes, row_episodes
from dextron_bench.leaderboard.rounds import Draw, Round
from dextron_bench.methods.isolation import sandbox
from dextron_bench.splits import fresh
from dextron_bench.splits.loading import Split
from dextron_bench.storage import hashing, records
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world.engine import Engine


def problems(round_: Round, redraw: bool = False, threads: int = 0, report: Progress = no_progress) -> list[str]:
    """How the files of a round contradict each other; with `redraw`, whether its settings follow from its beacon.

    Raises DamagedFile.
    """
    drawn, commitments = records.read(round_.draw_file, Draw), round_.commitments
    faults = []
    if drawn.commitments != hashing.sha256(round_.commitments_file):
        faults.append("its commitments were changed after its settings were drawn")
    played = read_episodes(round_)
    names = {f"{method}/{reaches}" for method, reaches in zip(played["method"], played["reaches"], strict=True)}
    faults += [f"{name} was announced and has not played" for name in sorted(commitments.entries.keys() - names)]
    faults += [f"{name} was not announced and has played" for name in sorted(names - commitments.entries.keys())]
    for reaches in drawn.digests if redraw else ():
        engine = Engine(montecarlo.SLOTS, threads)
        again = fresh.draw(reaches, round_.seed(drawn.value), engine, commitments.rows, report)
        if {split.name: split.digest for split in again} != drawn.digests[reaches]:
            faults.append(f"its settings on {reaches} reaches do not follow from its beacon")
    return faults


def row_problems(round_: Round, row: Row, count: int, threads: int) -> list[str]:
    """How a row plays a round differently now; none if it is not in the round.

    A baseline plays `count` rows of each split, 0 for all; a submission one split in the sandbox, where there is one,
    0 for all.
    """
    table = read_episodes(round_)
    about = {"method": row.result.method, "reaches": row.result.reaches, "seed": row.result.seed}
    stated = table[(table[list(about)] == pd.Series(about)).all(axis=1)]
    if stated.empty:
        return []
    splits = round_.splits(row.result.reaches)
    if not row.run.episodes.exists():
        return [line for split in splits for line in _faults_of_baseline(row, split, stated, count, threads)]
    if not sandbox.is_available():
        return []
    chosen = [splits[int(np.random.default_rng().integers(len(splits)))]] if count else splits
    return [line for split in chosen for line in _faults(split, stated, row_episodes(row, split, threads))]


def _faults_of_baseline(row: Row, split: Split, stated: pd.DataFrame, count: int, threads: int) -> list[str]:
    played = play_rows(agents_of(row.run, row.result), split, drawn_rows(len(split), count), threads)
    faults = _faults(split, stated, played.assign(actions=action_hashes(played["actions"])))
    if faults and 0 < count < len(split):  # An agent may draw numbers in an order that depends on the other episodes.
        return _faults_of_baseline(row, split, stated, 0, threads)
    return faults


def _faults(split: Split, stated: pd.DataFrame, played: pd.DataFrame) -> list[str]:
    """A line if episodes on a split differ from the stated ones."""
    stated = stated[stated["split"] == split.name].set_index("row")
    again = played.set_index("row")
    columns = ["score", "actions"]
    if len(stated) == len(split) and stated.loc[again.index, columns].equals(again[columns]):
        return []
    return [f"its episodes on {split.name} of the round differ from those that it plays again"]
