"""Lets baselines on the board play a split under tracks; the scores go beside the plain ones in their results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dextron_bench.leaderboard.baseline_check import agents_of, play_rows
from dextron_bench.runs import result_files
from dextron_bench.splits.loading import Split, UnknownSplit, load_split, splits_under
from dextron_bench.splits.tracks import TRACKS
from dextron_bench.storage import atomic
from dextron_bench.storage.progress import Progress
from dextron_bench.storage.run_folder import RunFolder


def splits_to_play(reaches: str, split: str, tracks: Sequence[str] = ()) -> list[Split]:
    """A source's split under each track, or under all tracks that the source has if `tracks` is empty.

    Raises UnknownTrack, UnknownSplit, DamagedSplit.
    """
    if tracks:
        return [load_split(reaches, name) for track in tracks for name in splits_under(reaches, [split], track)]
    return [load_split(reaches, name) for track in TRACKS for name in _under(reaches, split, track)]


def missing(result: dict[str, Any], splits: Sequence[Split]) -> list[Split]:
    """The splits, among some, that a row has not played in their present version."""
    played = {name: part["digest"] for name, part in result["splits"].items()}
    return [split for split in splits if played.get(split.name) != split.digest]


def play(run: RunFolder, result: dict[str, Any], splits: Sequence[Split], threads: int, report: Progress) -> None:
    """Plays splits with the agent of a baseline's row, and writes the scores of each into its result."""
    new_agent, done, total = agents_of(run, result), 0, sum(len(split) for split in splits)
    for split in splits:
        table = play_rows(new_agent, split, np.arange(len(split)), threads)
        result = {**result, "splits": {**result["splits"], **result_files.scores_by_split(table)}}
        atomic.write_json(run.result, result)
        report(done := done + len(split), total)


def _under(reaches: str, split: str, track: str) -> list[str]:
    """The name of a split under a track; empty if the source has no bottles for it."""
    try:
        return splits_under(reaches, [split], track)
    except UnknownSplit:
        return []
