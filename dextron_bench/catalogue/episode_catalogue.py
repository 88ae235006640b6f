"""The episodes of many runs as one table, in the words of the command line."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from dextron_bench.catalogue import selection
from dextron_bench.reaches import sources
from dextron_bench.reaches.recorded import parsing
from dextron_bench.reaches.recorded.parsing import RecordingError
from dextron_bench.reaches.setting import Stratum, UnknownReach
from dextron_bench.runs import run_files
from dextron_bench.storage import hashing
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.world import model

COLUMNS = {  # The columns that expressions name, and what they say.
    "method": "name on the leaderboard",
    "reaches": "real, synthetic or minjerk",
    "seed": "seed of the agent",
    "split": "name of the split",
    "row": "row of the split",
    "return": "0 to 20",
    "success": "True or False",
    "cause": "how the episode ended",
    "closing_lag": "how much later than the expert the hand closed [s]",
    "steps": "control steps",
    "subject": "person who reached",
    "ring": "start of the hand: 0 (near) to 3 (far)",
    "angle": "start of the hand: 0 (-x) to 3 (-y)",
    "reach": "name of the reach",
    "offset_x": "[m]",
    "offset_y": "[m]",
    "duration_noise": "standard normal",
    "failure": "what the agent did wrong, or empty",
    "run": "folder of the run",
}
RENAMED = {"score": "return", "length": "steps"}
STATE = "final"  # The last state of an episode; tables of earlier versions lack it.


def read(places: Sequence[Path]) -> pd.DataFrame:
    """The episodes of all runs at places: COLUMNS and STATE; the index is a key of each episode.

    Raises NoEpisodes, DamagedFile.
    """
    table = pd.concat([_episodes(run) for run in selection.runs_at(places)])
    return table[~table.index.duplicated()]


def with_actions(episode: pd.Series) -> pd.DataFrame:
    """The row of an episode of the catalogue in the table of its run, as `rerecording.rerecord` takes it.

    Raises NoEpisodes if the run has changed, and DamagedFile.
    """
    run = RunFolder(Path(episode["run"]))
    table = run_files.stored_episodes(run, ())
    row = table[(table["split"] == episode["split"]) & (table["row"] == episode["row"])] if len(table) else table
    if len(row) != 1 or row["score"].iloc[0] != episode["return"]:
        raise selection.NoEpisodes(f"{run.path} has changed since the catalogue was read; start `browse` again")
    return row.assign(folder=str(run.path), **selection.run_identity(run))


def last_state(episode: pd.Series) -> np.ndarray | None:
    """The last state (48,) of an episode of the catalogue; None if its table has none that can be drawn."""
    try:
        state = np.array(episode[STATE], float)
    except (TypeError, ValueError):
        return None
    return state if state.shape == (model.STATE,) and np.isfinite(state).all() else None


def _episodes(run: RunFolder) -> pd.DataFrame:
    stored = run_files.stored_episodes(run, ())
    table = stored.rename(columns=RENAMED).assign(run=str(run.path), **selection.run_identity(run))
    if table.empty:
        return pd.DataFrame(columns=[*COLUMNS, STATE])
    groups = _groups(table["reaches"].iloc[0], table["reach"].unique())
    table[["subject", "ring", "angle"]] = pd.DataFrame(table["reach"].map(groups).tolist(), index=table.index)
    table = table if STATE in table else table.assign(**{STATE: None})
    names = zip(table["split"], table["row"], strict=True)
    table.index = pd.Index([hashing.digest(f"{run.path}\n{split}\n{row}".encode())[:16] for split, row in names])
    return table[[*COLUMNS, STATE]]


def _groups(reaches: str, names: Iterable[str]) -> dict[str, tuple[str, float, float]]:
    """Subject, ring and angle of each reach; empty and NaN if this version does not know it."""
    source = None if reaches == "real" else sources.open_source(reaches)  # Names of recorded reaches are enough.
    groups = {}
    for name in names:
        try:
            stratum = source.stratum(name) if source else Stratum(*parsing.subject_and_region(name))
            groups[name] = stratum.subject, float(stratum.ring), float(stratum.angle)
        except (UnknownReach, RecordingError):
            groups[name] = "", np.nan, np.nan
    return groups
