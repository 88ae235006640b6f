"""Recordings after the fact: of episodes in the tables of runs, made from the actions that were taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.replay import replay
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import from_frame
from dextron_bench.runs import recording_files, run_files, selection
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import atomic
from dextron_bench.world import model

Report = Callable[[int, int], None]  # Told (recordings made, all to make).


class Unplayable(ValueError):
    """An episode that cannot be recorded after the fact; the message says why, and what to do."""


def restore(picked: pd.DataFrame, report: Report = lambda done, total: None) -> list[Path]:
    """The recordings of picked episodes, in order; those that are missing, damaged or of another episode are made.

    Raises Unplayable, UnwritableRecording, MissingData, UnknownSplit.
    """
    rows = picked.to_dict("records")
    files = [recording_files.recording_file(Path(row["folder"]), row["split"], row["row"]) for row in rows]
    wrong = _wrong(files, rows)
    missing = picked[[bool(why) for why in wrong]]
    for row, why in zip(rows, wrong, strict=True):
        _check_playable(row, why)
    done = 0
    for _, group in missing.groupby(["folder", "split"], sort=False):
        for _ in _record(group):
            done += 1
            report(done, len(missing))
    return files


def _wrong(files: Sequence[Path], rows: Sequence[dict[Any, Any]]) -> list[str]:
    """Why each file is not the recording of its row; nothing where it is."""
    told = recording.summarise([file for file in files if file.exists()])
    return [_why(next(told), row) if file.exists() else "missing" for file, row in zip(files, rows, strict=True)]


def _why(summary: recording.Summary, row: dict[Any, Any]) -> str:
    if summary.damage:
        return summary.damage
    expected = {"split_digest": row["digest"], "episode_return": row["score"], "steps": row["length"]}
    other = [name for name, value in expected.items() if summary.properties.get(name) != value]
    return f"is of an episode with another {other[0].replace('_', ' ')}" if other else ""


def _check_playable(row: dict[Any, Any], why: str) -> None:
    """Raises Unplayable where a recording is wrong and nothing is left to make it from."""
    folder = Path(row["folder"])
    called, again = f"{row['split']} row {row['row']} of {folder}", "give the command that made the run again"
    if not why:
        return
    if not hasattr(row.get("actions"), "__len__"):
        told = "has no recording" if why == "missing" else f"has a recording that {why}"
        raise Unplayable(
            f"{called} {told}, and its actions were not kept; remove {folder / run_files.EPISODES} and {again}: "
            "episodes are played again, nothing is trained"
        )
    if atomic.read_json(folder / run_files.CONFIG).get("physics") != model.mjcf_hash():
        raise Unplayable(f"{called} was played with other physics than this version's; remove {folder} and {again}")
    if load_split(row["reaches"], row["split"]).digest != row["digest"]:
        raise Unplayable(f"{called} is of a version of the split that is no more; {again}")


def _record(group: pd.DataFrame) -> Iterator[Path]:
    """Plays the episodes of one run on one split again, and records them."""
    rows = group.to_dict("records")
    folder, name = Path(rows[0]["folder"]), rows[0]["reaches"]
    source, split, about = sources.open_source(name), load_split(name, rows[0]["split"]), selection.run_identity(folder)
    for place, episode in replay(source, from_frame(group), group["actions"].tolist()):
        row = rows[place]
        recording_files.record(folder, source, split, row["row"], _same(row, episode), about)
        yield recording_files.recording_file(folder, split.name, row["row"])


def _same(row: dict[Any, Any], episode: Episode) -> Episode:
    """The episode, with the failure that it had; raises Unplayable where it did not go as the row says."""
    episode = replace(episode, failure=row["failure"]) if row["failure"] and episode.failure else episode
    if (episode.score, len(episode.actions), episode.failure) != (row["score"], row["length"], row["failure"]):
        raise Unplayable(
            f"{row['split']} row {row['row']} of {row['folder']} goes otherwise when it is played again: return "
            f"{episode.score:g} after {len(episode.actions)} steps, not {row['score']:g} after {row['length']}; "
            "play it where it was played first, with the same versions (see its provenance.json)"
        )
    return episode
