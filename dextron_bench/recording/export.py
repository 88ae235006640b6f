"""Exports recordings to other formats: films, and tables with one row for each step."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.recording import film, summaries
from dextron_bench.recording.film_overlay import SMALLEST, Overlay
from dextron_bench.storage import atomic
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import model

FILMS = {".mp4": film.mp4, ".gif": film.gif}
TABLES = (".csv", ".parquet")


class UnknownSuffix(BadInput):
    """No export format has the suffix of the file name."""

    def __init__(self, file: Path) -> None:
        super().__init__(f"{file}: cannot export to {file.suffix!r}; choose from {', '.join([*FILMS, *TABLES])}")


def export(source: Path, into: Path, style: film.FilmStyle, progress: Progress = no_progress) -> None:
    """Writes the episode of a recording to `into` atomically, in the format that the file's suffix names.

    `style` is for films; `progress` receives numbers of frames. Raises UnknownSuffix, BrokenRecording, Failed,
    NoGraphics, Failed, OSError.
    """
    suffix = into.suffix.lower()
    if suffix not in (*FILMS, *TABLES):
        raise UnknownSuffix(into)
    episode = summaries.read_safely(source).episode
    if suffix in FILMS:
        draw = Overlay(episode, style.height).draw if style.overlay and style.height >= SMALLEST else film.unchanged
        atomic.write_atomically(into, lambda part: FILMS[suffix](part, episode.states, style, progress, draw))
    elif suffix == ".csv":
        atomic.write_atomically(into, lambda part: step_table(episode).to_csv(part, index=False))
    else:
        atomic.write_atomically(into, lambda part: step_table(episode).to_parquet(part, index=False))


def step_table(episode: Episode) -> pd.DataFrame:
    """A table with one row for each of an episode's T + 1 states.

    Columns are `step`, `seconds`, the numbers of the state, `action` and `reward`. The reward is for the action in the
    same row. The last state has neither: both are NaN.
    """
    count = len(episode.states)
    per_action = {"action": episode.actions[:, 0], "reward": episode.rewards}
    return pd.DataFrame(
        {
            "step": np.arange(count),
            "seconds": np.round(np.arange(count) * model.CONTROL_STEP, 9),
            **dict(zip(model.state_names(), episode.states.T, strict=True)),
            **{name: np.append(values, np.nan) for name, values in per_action.items()},
        }
    )
