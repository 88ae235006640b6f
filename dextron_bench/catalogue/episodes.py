"""Episodes as one table, in the words of the command line: of many runs, or of recordings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from dextron_bench.reaches import sources
from dextron_bench.reaches.recorded import parsing
from dextron_bench.reaches.recorded.parsing import RecordingError
from dextron_bench.reaches.setting import Stratum, UnknownReach
from dextron_bench.runs import result_files, run_files
from dextron_bench.storage import atomic, hashing, schemas
from dextron_bench.storage.run_folder import RunFolder, below
from dextron_bench.world import model

if TYPE_CHECKING:
    from dextron_bench.recording import Summary

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
PROPERTIES = ("method", "reaches", "seed", "split", "row")  # Of the recording of one episode.
STATE = "final"  # The last state of an episode; tables of earlier versions lack it.


class NoEpisodes(ValueError):
    """A place without runs or recordings, or a filter that no episode passes."""


def read(places: Sequence[Path]) -> pd.DataFrame:
    """The episodes of all runs at places: COLUMNS, `digest` of the split, and STATE; the index is a key of each.

    Raises NoEpisodes, DamagedFile.
    """
    table = pd.concat([_episodes(run) for run in runs_at(places)])
    return table[~table.index.duplicated()]


def of_recordings(summaries: Sequence[Summary]) -> pd.DataFrame:
    """A row for each undamaged recording of one episode, with the COLUMNS that it has; the index is its place.

    Raises DamagedFile.
    """
    rows = {
        place: {name: summary.properties[name] for name in PROPERTIES}
        | {"return": summary.properties["episode_return"], "steps": summary.properties["steps"]}
        | {"success": summary.properties["outcome"] == "success", "cause": cause(summary)}
        for place, summary in enumerate(summaries)
        if not summary.damage and all(name in summary.properties for name in PROPERTIES)
    }
    columns = [*PROPERTIES, "return", "steps", "success", "cause"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).astype({"success": bool})


def cause(summary: Summary) -> str | None:
    """Why the episode of a recording ended as it did; raises DamagedFile.

    Recordings of version 0.1 do not say it: for them it is known in the folder of their run only.
    """
    if isinstance(stated := summary.properties.get("cause"), str):
        return stated
    run, place = RunFolder(summary.file.parent.parent), (summary.properties.get("split"), summary.properties.get("row"))
    return _causes(run, run.episodes.stat().st_mtime_ns).get(place) if run.episodes.exists() else None


def with_actions(table: pd.DataFrame) -> pd.DataFrame:
    """The episodes of a table with the `actions` (T,) in their runs, None if they were not kept.

    Raises NoEpisodes if a run has changed since, and DamagedFile.
    """
    actions = []
    stored = {run: run_files.stored_episodes(RunFolder(Path(run)), ()) for run in table["run"].unique()}
    for episode in table.to_dict("records"):
        rows = stored[episode["run"]]
        rows = rows[(rows["split"] == episode["split"]) & (rows["row"] == episode["row"])] if len(rows) else rows
        if len(rows) != 1 or rows["score"].iloc[0] != episode["return"]:
            raise NoEpisodes(f"{episode['run']} has changed since its episodes were read; start the command again")
        actions.append(rows["actions"].iloc[0] if "actions" in rows else None)
    return table.assign(actions=pd.Series(actions, table.index, object))


def runs_at(places: Sequence[Path]) -> list[RunFolder]:
    """The folders of runs at or below places, each once; raises NoEpisodes."""
    runs: dict[RunFolder, None] = {}
    for place in places:
        if place.is_file():
            raise NoEpisodes(f"{place} is a file, and episodes are selected from runs; name a run's folder instead")
        place_runs = list(below(place, RunFolder(place).episodes.name))
        if not place_runs:
            raise NoEpisodes(f"no runs at {place} to select episodes from; make one with `dextron-bench run`")
        runs |= dict.fromkeys(place_runs)
    return list(runs)


def run_identity(run: RunFolder) -> dict[str, Any]:
    """Method, source of reaches and seed of a run, as its recordings have them; raises DamagedFile."""
    if run.result.exists():
        content = result_files.read_result(run.result)
    else:  # The run is not finished; its path has the label.
        content = schemas.read(run.config, schemas.CONFIG) | {"method": run.label}
    try:
        return {name: content[name] for name in ("method", "reaches", "seed")}
    except KeyError as error:
        raise atomic.OtherForm(run.config, f"it lacks {error}") from error


def last_state(episode: pd.Series) -> np.ndarray | None:
    """The last state (48,) of an episode of the catalogue; None if its table has none that can be drawn."""
    try:
        state = np.array(episode[STATE], float)
    except (TypeError, ValueError):
        return None
    return state if state.shape == (model.STATE,) and np.isfinite(state).all() else None


def _episodes(run: RunFolder) -> pd.DataFrame:
    table = run_files.stored_episodes(run, ()).rename(columns=RENAMED).assign(run=str(run.path), **run_identity(run))
    if table.empty:
        return pd.DataFrame(columns=[*COLUMNS, "digest", STATE])
    groups = _groups(table["reaches"].iloc[0], table["reach"].unique())
    table[["subject", "ring", "angle"]] = pd.DataFrame(table["reach"].map(groups).tolist(), index=table.index)
    table = table if STATE in table else table.assign(**{STATE: None})
    names = zip(table["split"], table["row"], strict=True)
    table.index = pd.Index([hashing.digest(f"{run.path}\n{split}\n{row}".encode())[:16] for split, row in names])
    return table[[*COLUMNS, "digest", STATE]]


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


@cache
def _causes(run: RunFolder, written: int) -> dict[tuple[object, object], str]:
    """The cause of each episode of a run, by split and row, from the table that was `written` at this time [ns]."""
    table = run_files.stored_episodes(run, ())
    return dict(zip(zip(table["split"], table["row"], strict=True), table["cause"], strict=True))
