"""Recordings as other files: films, and tables with a row for each step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.recording import film, summaries
from dextron_bench.storage import atomic
from dextron_bench.world import model

FILMS = {".mp4": film.mp4, ".gif": film.gif}
TABLES = (".csv", ".parquet")


class UnknownEnding(ValueError):
    """A file name that does not end like any of the formats."""

    def __init__(self, file: Path) -> None:
        super().__init__(f"{file}: cannot export to {file.suffix!r}; choose from {', '.join([*FILMS, *TABLES])}")


def export(source: Path, into: Path, look: film.FilmStyle, report: film.Report = lambda done, total: None) -> None:
    """Writes a recording's episode to `into`, in the format that its name ends with, whole or not at all.

    `look` is that of films, and `report` is told (pictures drawn, all). Raises UnknownEnding, BrokenRecording,
    NoGraphics, NoEncoder.
    """
    ending = into.suffix.lower()
    if ending not in (*FILMS, *TABLES):
        raise UnknownEnding(into)
    episode = summaries.read_safely(source).episode
    if ending in FILMS:
        atomic.write_atomically(into, lambda part: FILMS[ending](part, episode.states, look, report))
    elif ending == ".csv":
        atomic.write_atomically(into, lambda part: step_table(episode).to_csv(part, index=False))
    else:
        atomic.write_atomically(into, lambda part: step_table(episode).to_parquet(part, index=False))


def step_table(episode: Episode) -> pd.DataFrame:
    """A row for each of an episode's T + 1 states: `step`, `seconds`, the state, the action that was taken in it and
    the reward that the action earned; the last state has neither.
    """
    count = len(episode.states)
    after = {"action": episode.actions[:, 0], "reward": episode.rewards}
    return pd.DataFrame(
        {
            "step": np.arange(count),
            "seconds": np.round(np.arange(count) * model.CONTROL_STEP, 9),
            **dict(zip(model.state_names(), episode.states.T, strict=True)),
            **{name: np.append(values, np.nan) for name, values in after.items()},
        }
    )
