"""Lets baselines on the board play fresh settings, the same for all, and verifies what rows scored on fresh ones."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.leaderboard.baseline_check import agents_of, drawn_rows, play_rows
from dextron_bench.reaches import sources
from dextron_bench.splits.fresh_settings import FreshSettings, from_frame, to_frame
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, schemas, tables
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.submissions import replay_check
from dextron_bench.world import model

FOLDER = "fresh"  # In the leaderboard's folder: the fresh settings of all baselines, a table for each source.


def load_or_draw(
    board: Path, reaches: str, beacon: str = "", rows: int = 0, threads: int = 0, report: Progress = no_progress
) -> tuple[FreshSettings, list[Split]]:
    """The fresh settings of a board's baselines on a source: the stored ones, or newly drawn ones, which are stored.

    Stored settings are used if they are of the present physics, and of the beacon and the number of rows for each split
    if these are given. Baselines have no bundle: the hash of the physics replaces its hash. Raises DamagedFile, and the
    errors of `FreshSettings.draw`.
    """
    physics, stored = model.mjcf_hash(), stored_settings(board, reaches)
    if stored is not None:
        known = stored[0]
        if known.submission == physics and beacon in ("", known.beacon) and rows in (0, known.rows):
            return stored
    fresh = FreshSettings(physics, beacon, rows) if beacon else FreshSettings(physics, rows=rows)
    splits = fresh.draw(reaches, threads, report)
    file = board / FOLDER / f"{reaches}.parquet"
    tables.write(file, to_frame(splits))
    atomic.write_json(file.with_suffix(".json"), asdict(fresh))
    return fresh, splits


def stored_settings(board: Path, reaches: str) -> tuple[FreshSettings, list[Split]] | None:
    """The fresh settings that a board's baselines on a source have played; None if there are none.

    Raises DamagedFile.
    """
    file = board / FOLDER / f"{reaches}.parquet"
    about = file.with_suffix(".json")
    if not (about.exists() and file.exists()):
        return None
    fresh = FreshSettings(**schemas.read(about, schemas.FRESH_SETTINGS))
    return fresh, from_frame(tables.read_own(file, tables.CASES), reaches)


def play(
    run: RunFolder, result: dict[str, Any], fresh: FreshSettings, splits: list[Split], threads: int, report: Progress
) -> None:
    """Plays fresh settings with the agent of a baseline's row, and writes the scores into its result."""
    new_agent, parts, total = agents_of(run, result), [], sum(len(split) for split in splits)
    for split in splits:
        parts.append(play_rows(new_agent, split, np.arange(len(split)), threads))
        report(sum(map(len, parts)), total)
    atomic.write_json(run.result, {**result, "fresh": fresh.scores(pd.concat(parts))})


def problems(
    run: RunFolder, result: dict[str, Any], board: Path, count: int, redraw: bool, threads: int, report: Progress
) -> list[str]:
    """How the fresh scores of a row differ from its episodes, played again; empty if they are equal.

    Of a baseline, `count` rows of each split are played, 0 for all. With `redraw`, the settings are drawn again, too.
    """
    claimed, reaches = result["fresh"], result["reaches"]
    if run.fresh.exists():
        splits = from_frame(tables.read_own(run.fresh, tables.FRESH_EPISODES), reaches)
        faults = _faults_of_submission(run, claimed, splits, threads, report)
    elif (known := stored_settings(board, reaches)) is None:
        return [f"its fresh settings are missing from {board / FOLDER}"]
    else:
        stored, splits = known
        if (stored.submission, stored.beacon) != (claimed["submission"], claimed["beacon"]):
            return ["it played other fresh settings than the other baselines"]
        faults = _faults_of_baseline(run, result, splits, count, threads)
    return faults or (_redrawn(claimed, reaches, splits, threads, report) if redraw else [])


def _faults_of_submission(
    run: RunFolder, claimed: dict[str, Any], splits: list[Split], threads: int, report: Progress
) -> list[str]:
    """How the fresh scores of a submission's row differ from its actions, played again."""
    table = tables.read_own(run.fresh, tables.FRESH_EPISODES)
    source = sources.open_source(splits[0].reaches)
    replayed = replay_check.replay_table(source, splits, table, threads, report)
    stated = FreshSettings(claimed["submission"], claimed["beacon"])
    if replayed.exact == replayed.episodes and stated.scores(replayed.rows) == claimed:
        return []
    return ["its scores on fresh settings differ from its actions, played again", *replayed.differing]


def _faults_of_baseline(
    run: RunFolder, result: dict[str, Any], splits: list[Split], count: int, threads: int
) -> list[str]:
    """How the fresh scores of a baseline's row differ from the scores of its agent, run again."""
    new_agent = agents_of(run, result)
    for split in splits:
        known = result["fresh"]["splits"].get(split.name, {"digest": "", "scores": []})
        if known["digest"] != split.digest or len(known["scores"]) != len(split):
            return [f"it has no scores for every fresh setting of {split.name}"]
        rows = drawn_rows(len(split), count)
        if play_rows(new_agent, split, rows, threads)["score"].tolist() != [known["scores"][row] for row in rows]:
            return [f"its scores on fresh settings of {split.name} differ from its episodes, run again"]
    return []


def _redrawn(claimed: dict[str, Any], reaches: str, splits: list[Split], threads: int, report: Progress) -> list[str]:
    """A problem if the settings do not follow from the hash of the submission and the beacon."""
    fresh = FreshSettings(claimed["submission"], claimed["beacon"], len(splits[0]))
    again = {split.name: split.digest for split in fresh.draw(reaches, threads, report)}
    differing = [split.name for split in splits if again.get(split.name) != split.digest]
    return [f"its fresh settings of {', '.join(differing)} do not follow from its beacon"] if differing else []
