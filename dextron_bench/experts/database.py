"""Expert databases G_s: the draws of a search that grasped the bottle, and statistics of all draws."""

from __future__ import annotations

import itertools
import json
from dataclasses import asdict
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.experts import blocks, montecarlo
from dextron_bench.reaches import setting
from dextron_bench.storage import atomic, hashing, provenance
from dextron_bench.world import model, task

BANDS = 9  # Equal bands of d_c in the statistics.


class OtherPhysics(ValueError):
    """A database that was searched with other physics: a search finds other outcomes now."""


class DamagedDatabase(ValueError):
    """A database that cannot be read, or whose rows differ from its summary."""


def save(
    draws: pd.DataFrame, source: setting.Source, search: montecarlo.Search, folder: Path, name: str
) -> tuple[Path, dict[str, Any]]:
    """Writes the kept rows as `<name>.parquet` and a summary as `<name>.json`; returns the file and the summary."""
    kept = draws[draws["score"] > blocks.KEPT].reset_index(drop=True).astype({"length": int})
    file = folder / f"{name}.parquet"
    atomic.write_atomically(file, lambda part: kept.to_parquet(part, compression="zstd"))
    about = {
        "search": asdict(search),
        "digest": rows_digest(kept),
        "draws": len(draws),
        "settings": len(draws) // search.experts,
        "kept": len(kept),
        "solved": int((kept["score"] == task.SUCCESS).sum()),
        "statistics": statistics(draws, source).to_dict("records"),
        "provenance": blocks.read_makers(folder),
    }
    atomic.write_json(file.with_suffix(".json"), about)
    return file, about


def load(file: Path) -> pd.DataFrame:
    """The rows of a database, verified against its summary; raises DamagedDatabase, FileNotFoundError."""
    expected = summary(file)["digest"]
    try:
        rows = pd.read_parquet(file)
        actual = rows_digest(rows)
    except (OSError, ValueError, KeyError, TypeError) as error:
        if isinstance(error, FileNotFoundError) or getattr(error, "errno", None) is not None:  # Of the system.
            raise
        raise DamagedDatabase(f"expert database {file} is damaged ({error}); make it again with `data mc`") from error
    if actual != expected:
        raise DamagedDatabase(f"expert database {file} does not match its summary; make it again with `data mc`")
    return rows


def summary(file: Path) -> dict[str, Any]:
    """A database's search, counts, statistics and provenance; raises DamagedDatabase, FileNotFoundError."""
    try:
        about = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
    except ValueError as error:
        raise DamagedDatabase(f"summary of expert database {file} is damaged ({error}); make it again") from error
    if not isinstance(about, dict) or not {"digest", "search", "statistics"} <= set(about):
        raise DamagedDatabase(f"summary of expert database {file} is incomplete; make it again with `data mc`")
    return about


def check_physics(summary: dict[str, Any]) -> None:
    """Raises OtherPhysics if the search of a summary was played with other physics than this version's."""
    physics = provenance.physics_of(summary)
    if physics != model.mjcf_hash():
        raise OtherPhysics(
            f"the database was searched with physics {physics[:8] or 'unknown'}, and this version has "
            f"{model.mjcf_hash()[:8]}; search again without --extend"
        )


def load_shipped(reaches: str) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The shipped database of a source of reaches, and its summary; raises FileNotFoundError if none ships."""
    with as_file(files("dextron_bench") / "data") as folder:
        file = folder / f"experts-{reaches}.parquet"
        if not file.exists():
            raise FileNotFoundError(f"no expert database ships for {reaches!r}; make one with `data mc`")
        return load(file), summary(file)


def rows_digest(rows: pd.DataFrame) -> str:
    """SHA-256 of a database's rows in order."""
    names = "\n".join(rows["reach"]).encode()
    numbers = rows.drop(columns="reach").sort_index(axis=1)
    return hashing.digest(names, *(np.ascontiguousarray(numbers[c], "<f8").tobytes() for c in numbers))


def statistics(draws: pd.DataFrame, source: setting.Source) -> pd.DataFrame:
    """Counts and success rates by subject, ring, angle, start region, d_c [of the first distance] and duration [s].

    Columns: by, value, draws, kept, solved, then `kept_rate` and `solved_rate` in [0, 1].
    """
    outcome = pd.DataFrame({"kept": draws["score"] > blocks.KEPT, "solved": draws["score"] == task.SUCCESS})
    parts = []
    for by, key in _groups(draws, source).items():
        counted = outcome.groupby(key, sort=True).agg(["size", "sum"])
        part = pd.DataFrame(
            {"draws": counted["kept", "size"], "kept": counted["kept", "sum"], "solved": counted["solved", "sum"]}
        )
        parts.append(part.rename_axis("value").reset_index().assign(by=by))
    table = pd.concat(parts, ignore_index=True)
    table["kept_rate"], table["solved_rate"] = table["kept"] / table["draws"], table["solved"] / table["draws"]
    return table[["by", "value", "draws", "kept", "solved", "kept_rate", "solved_rate"]]


def _groups(draws: pd.DataFrame, source: setting.Source) -> dict[str, pd.Series]:
    """The group of each draw as text, for each way to group the draws."""
    strata = {name: source.stratum(name) for name in draws["reach"].unique()}
    for_reach = draws["reach"].map
    return {
        "all": pd.Series("all", index=draws.index),
        "subject": for_reach(lambda name: strata[name].subject),
        "ring": for_reach(lambda name: str(strata[name].ring)),
        "angle": for_reach(lambda name: str(strata[name].angle)),
        "region": for_reach(lambda name: f"{strata[name].ring}{strata[name].angle}"),
        "d_c": _bands(draws["critical"], np.linspace(0.0, 0.9, BANDS + 1)),
        "duration": _bands(pd.Series([source.duration(s) for s in setting.from_frame(draws)]), np.arange(11.0)),
    }


def _bands(values: pd.Series, edges: np.ndarray) -> pd.Series:
    """The band of each value as text, such as "0.1 to 0.2"."""
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    names = np.array([f"{low:.1f} to {high:.1f}" for low, high in itertools.pairwise(edges)])
    return pd.Series(names[place], index=values.index)
