"""The files of a run: whose it is, its episodes, its recordings and its result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation import diagnosis, predictions
from dextron_bench.evaluation.episodes import Episode, action_hashes, trace
from dextron_bench.experts.policies import Case
from dextron_bench.methods import loading as entrants
from dextron_bench.methods import registry as methods
from dextron_bench.reaches import setting
from dextron_bench.splits import loading as splits
from dextron_bench.storage import atomic, folder_config, provenance
from dextron_bench.success import network
from dextron_bench.success import predict as insight
from dextron_bench.world import model

CONFIG = "config.json"
PROVENANCE = "provenance.json"
EPISODES = "episodes.parquet"
RESULT = "result.json"
MAKER = ("method", "code", "settings")  # Of a run's config, what a result repeats: by it the agent is made again.
HELD = "run", "remove it, or choose another folder with --runs"
MANIFEST = "recordings.json"  # The SHA-256 of every recording.


def config(method: methods.Entrant, reaches: str, seed: int) -> dict[str, Any]:
    """What a method's run depends on, as `config.json` says it."""
    return {
        "method": method.name,
        "code": entrants.origin(type(method)),
        "settings": methods.settings(method),
        "reaches": reaches,
        "seed": seed,
        "physics": model.mjcf_hash(),
    }


def check(folder: Path, config: dict[str, Any]) -> None:
    """Raises FolderMismatch where the folder holds a run of another config, DamagedFile where that cannot be told."""
    folder_config.check(folder / CONFIG, config, *HELD)


def claim(folder: Path, config: dict[str, Any]) -> None:
    """Makes the folder the run's that has this config; raises what `check` does."""
    if not (folder / CONFIG).exists():  # Written last, so that whoever finds it finds the rest.
        atomic.write_json(folder / PROVENANCE, provenance.collect(model.mjcf_hash()))
    folder_config.write_or_check(folder / CONFIG, config, *HELD)


def row(split: splits.Split, index: int, episode: Episode) -> dict[str, Any]:
    """An episode's row of the table of episodes; with its actions it can be played again, bit for bit."""
    found = diagnosis.diagnose(episode, split.cases[index])
    return {
        "split": split.name,
        "digest": split.digest,
        "row": index,
        **asdict(episode.setting),
        "score": episode.score,
        "success": episode.success,
        "length": len(episode.actions),
        "terminated": episode.terminated,
        "truncated": episode.truncated,
        "failure": episode.failure,
        "cause": found.cause,
        "closing_lag": found.closing_lag,
        "actions": episode.actions[:, 0],
        "trace": trace(episode),
        "final": episode.states[-1],
    }


def stored(folder: Path, wanted: Sequence[splits.Split]) -> pd.DataFrame:
    """Episodes already in the folder, less those of splits that have changed since; raises DamagedFile."""
    file = folder / EPISODES
    if not file.exists():
        return pd.DataFrame()
    try:
        episodes = pd.read_parquet(file)
        now = episodes["split"].map({split.name: split.digest for split in wanted})
        return episodes[now.isna() | (now == episodes["digest"])]
    except (OSError, ValueError, KeyError) as error:
        raise atomic.DamagedFile(file, error) from error


def store(folder: Path, episodes: pd.DataFrame) -> None:
    """Puts all episodes of a run in place of those that were there."""
    atomic.write_atomically(folder / EPISODES, lambda part: episodes.to_parquet(part))


def unrecorded(folder: Path, done: pd.DataFrame, record: int) -> bool:
    """Whether a recording is missing; an episode that failed before its first step has none."""
    wanted = done[(done["row"] < record) & (done["length"] > 0)]
    places = (recording_file(folder, split, row) for split, row in zip(wanted["split"], wanted["row"], strict=True))
    return not all(place.exists() for place in places)


def record(
    folder: Path, source: setting.Source, split: splits.Split, index: int, episode: Episode, about: dict[str, Any]
) -> None:
    """Writes an episode's recording: whose it is, in `about`, and what the success model that ships thinks of it.

    The run's manifest then has the file's SHA-256.
    """
    from dextron_bench import recording

    properties = {**about, "split": split.name, "split_digest": split.digest, "row": index}
    properties["physics"] = model.mjcf_hash()
    file, path = recording_file(folder, split.name, index), source.path(episode.setting)
    sha256 = recording.write(file, episode, path, properties, _insight(source, split.cases[index], episode))
    atomic.write_json(folder / MANIFEST, manifest(folder) | {file.name: sha256})


def manifest(folder: Path) -> dict[str, str]:
    """The SHA-256 of each of a run's recordings by the file's name; raises DamagedFile."""
    return atomic.read_json(folder / MANIFEST) if (folder / MANIFEST).exists() else {}


def recording_file(folder: Path, split: str, index: int) -> Path:
    """Where the recording of a split's row lies in a run's folder."""
    return folder / "recordings" / f"{split}-{index:04d}.rrd"


def _insight(source: setting.Source, case: Case, episode: Episode) -> predictions.Insight | None:
    """None where no success model ships for the source."""
    try:
        judge = network.shipped(source.name)
    except network.MissingModel:
        return None
    return insight.look(judge, source, case, episode)


def conclude(folder: Path, episodes: pd.DataFrame, about: dict[str, Any], seconds: float | None = None) -> None:
    """Writes the result: every episode's score, from which the leaderboard is computed, and how episodes end.

    `seconds` of training are part of where it was made, which differs from one making to the next.
    """
    made = atomic.read_json(folder / CONFIG)
    found = {"splits": scores(episodes), "provenance": atomic.read_json(folder / PROVENANCE)}
    found["provenance"] |= {} if seconds is None else {"seconds": seconds}
    found["maker"] = {name: made[name] for name in MAKER if name in made}
    atomic.write_json(folder / RESULT, {**about, **found})


def scores(episodes: pd.DataFrame) -> dict[str, Any]:
    """What a result says of each split, from the rows of its episodes."""
    return {str(name): _scores(rows) for name, rows in episodes.groupby("split", sort=False)}


def _scores(rows: pd.DataFrame) -> dict[str, Any]:
    told = {
        "digest": rows["digest"].iloc[0],
        "scores": rows["score"].tolist(),
        "failed": int((rows["failure"] != "").sum()),
        "causes": {cause: int(count) for cause, count in rows["cause"].value_counts(sort=False).items()},
        "closing_lag": None if rows["closing_lag"].isna().all() else round(float(rows["closing_lag"].median()), 3),
    }
    kept = rows["actions"] if "actions" in rows else pd.Series([None])
    return told if kept.isna().any() else told | {"actions": action_hashes(kept)}


def results(folder: Path) -> Iterator[dict[str, Any]]:
    """Every result below a folder of runs; raises DamagedFile."""
    for file in sorted(folder.glob(f"*/*/seed*/{RESULT}")):
        yield read_result(file)


def read_result(file: Path) -> dict[str, Any]:
    """The content of a `result.json`; raises DamagedFile."""
    found = atomic.read_json(file)
    try:
        parts = [found["method"], found["reaches"], found["seed"]]
        for each in found["splits"].values():
            parts += [each["digest"][:8], sum(each["scores"]), each["failed"], sum(each["causes"].values())]
    except (KeyError, TypeError, AttributeError) as error:
        raise atomic.DamagedFile(file, f"no result: {type(error).__name__} {error}") from error
    return found
