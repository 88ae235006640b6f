"""Recordings made afterwards: episodes played again from the actions in their table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench import recording
from dextron_bench.catalogue import episodes
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.replay import replay
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import from_frame
from dextron_bench.runs import recording_files, result_files
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import provenance, schemas
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.world import model

MISSING = "missing"


class Unplayable(ValueError):
    """An episode that cannot be recorded afterwards; the message says why, and what to do."""


def rerecord(table: pd.DataFrame, report: Progress = no_progress) -> list[Path]:
    """The recordings of selected episodes, in order; makes recordings that are missing, damaged or of another episode.

    Raises Unplayable, UnwritableRecording, MissingData, UnknownSplit, and the errors of `episodes.with_actions`.
    """
    table = episodes.with_actions(table)
    rows = table.to_dict("records")
    files = [RunFolder(Path(row["run"])).recording(row["split"], row["row"]) for row in rows]
    faults = _faults(files, rows)
    for row, fault in zip(rows, faults, strict=True):
        if fault:
            _check_playable(row, fault)
    to_make = table[[bool(fault) for fault in faults]]
    done = 0
    for _, group in to_make.groupby(["run", "split"], sort=False):
        for _ in _record(group):
            done += 1
            report(done, len(to_make))
    return files


def _faults(files: Sequence[Path], rows: Sequence[dict[Any, Any]]) -> list[str]:
    """For each file, why it is not the recording of its row; empty if it is."""
    summaries = recording.summarise([file for file in files if file.exists()])
    return [_fault(next(summaries), row) if file.exists() else MISSING for file, row in zip(files, rows, strict=True)]


def _fault(summary: recording.Summary, row: dict[Any, Any]) -> str:
    if summary.damage:
        return summary.damage
    expected = {"split_digest": row["digest"], "episode_return": row["return"], "steps": row["steps"]}
    differing = [name for name, value in expected.items() if summary.properties.get(name) != value]
    return f"is of an episode with another {differing[0].replace('_', ' ')}" if differing else ""


def _check_playable(row: dict[Any, Any], fault: str) -> None:
    """Raises Unplayable if nothing is left to make a recording from."""
    run = RunFolder(Path(row["run"]))
    name, advice = f"{row['split']} row {row['row']} of {run.path}", "run the command that made the run again"
    if not hasattr(row.get("actions"), "__len__"):
        problem = "has no recording" if fault == MISSING else f"has a recording that {fault}"
        raise Unplayable(
            f"{name} {problem}, and its actions were not kept; remove {run.episodes} and {advice}: "
            "it plays the episodes again and trains nothing"
        )
    if _physics(run) != model.mjcf_hash():
        raise Unplayable(f"{name} was played with other physics than this version's; remove {run.path} and {advice}")
    if load_split(row["reaches"], row["split"]).digest != row["digest"]:
        raise Unplayable(f"{name} is of an older version of the split; {advice}")


def _physics(run: RunFolder) -> str:
    """The hash of the physics of a run; on a leaderboard, the result has it."""
    if run.config.exists():
        return str(schemas.read(run.config, schemas.CONFIG).get("physics"))
    return provenance.physics_of(result_files.read_result(run.result))


def _record(group: pd.DataFrame) -> Iterator[None]:
    """Plays the episodes of one run on one split again, and records them; yields after each."""
    rows = group.to_dict("records")
    run, reaches = RunFolder(Path(rows[0]["run"])), rows[0]["reaches"]
    source, split = sources.open_source(reaches), load_split(reaches, rows[0]["split"])
    about, settings = episodes.run_identity(run), from_frame(group)
    for place, episode in replay(source, split.rows(row["row"] for row in rows), group["actions"].tolist()):
        row = rows[place]
        if episode.setting != settings[place]:
            raise Unplayable(f"{row['split']} row {row['row']} of {row['run']} is no setting of this split")
        recording_files.record(run, source, split, row["row"], _as_recorded(row, episode), about)
        yield


def _as_recorded(row: dict[Any, Any], episode: Episode) -> Episode:
    """The episode with the failure in its row; raises Unplayable if the replay differs from the row."""
    episode = replace(episode, failure=row["failure"]) if row["failure"] and episode.failure else episode
    if (episode.score, len(episode.actions), episode.failure) != (row["return"], row["steps"], row["failure"]):
        raise Unplayable(
            f"{row['split']} row {row['row']} of {row['run']} differs when it is played again: return "
            f"{episode.score:g} after {len(episode.actions)} steps, not {row['return']:g} after {row['steps']}; "
            "play it on the machine and with the versions that its provenance.json names"
        )
    return episode
