"""Runs: one method, one seed, one source of reaches, evaluated on splits, in a folder that says how."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench import methods, provenance, splits
from dextron_bench.rollout import Episode, blaming, rollout
from dextron_bench.world import model, setting, sources

Report = Callable[[int, int], None]  # Told (done, all).

EPISODES = "episodes.parquet"
RESULT = "result.json"


class RunMismatch(ValueError):
    """A run folder that holds something else than what is asked for."""


class DamagedRun(ValueError):
    """A file of a run that is not whole; the message names it and says what to do."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"{file} is damaged ({why}); remove it and run again")


@dataclass(frozen=True, slots=True)
class Plan:
    """What to run: a method on a source's splits with one seed; the first `record` episodes of each are recorded."""

    method: str
    reaches: str
    splits: tuple[str, ...]
    seed: int
    record: int = 0

    def folder(self, runs: Path) -> Path:
        """Where the run lives."""
        return runs / methods.find(self.method).name / self.reaches / f"seed{self.seed}"


def quiet(done: int, total: int) -> None:
    """Reports nothing."""


def execute(plan: Plan, runs: Path, threads: int = 0, report: Report = quiet) -> Path:
    """Evaluates what the folder does not hold yet; returns the folder, with its `result.json`.

    `report` is told (episodes done, episodes in all) of each split. Raises RunMismatch, DamagedRun,
    UnknownMethod, UnknownSplit, MissingData, AgentError.
    """
    method = methods.create(plan.method)
    folder = plan.folder(runs)
    wanted = [splits.load(plan.reaches, name) for name in plan.splits]
    source = sources.open_source(plan.reaches)
    _claim(folder, plan, method)
    episodes = _stored(folder, wanted)
    for split in wanted:
        done = episodes[episodes["split"] == split.name] if len(episodes) else episodes
        if len(done) == len(split.cases) and not _unrecorded(folder, done, plan.record):
            continue
        fresh = _evaluate(method, source, split, plan, folder, threads, report)
        kept = [episodes[episodes["split"] != split.name]] if len(episodes) else []
        episodes = pd.concat([*kept, fresh], ignore_index=True)
        provenance.write_whole(folder / EPISODES, lambda part, e=episodes: e.to_parquet(part))
    _conclude(folder, plan, episodes)
    return folder


def results(folder: Path) -> Iterator[dict[str, Any]]:
    """Every result below a folder of runs; raises DamagedRun."""
    for file in sorted(folder.glob(f"*/*/seed*/{RESULT}")):
        yield read_result(file)


def read_result(file: Path) -> dict[str, Any]:
    """The content of a `result.json`; raises DamagedRun."""
    found = read_json(file)
    try:
        parts = [found["method"], found["reaches"], found["seed"]]
        parts += [(each["digest"][:8], sum(each["scores"]), each["failed"]) for each in found["splits"].values()]
    except (KeyError, TypeError, AttributeError) as error:
        raise DamagedRun(file, f"no result: {type(error).__name__} {error}") from error
    return found


def read_json(file: Path) -> dict[str, Any]:
    """A JSON object from a file; raises DamagedRun."""
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DamagedRun(file, error) from error
    if not isinstance(found, dict):
        raise DamagedRun(file, "it holds no JSON object")
    return found


def _evaluate(
    method: methods.Method,
    source: setting.Source,
    split: splits.Split,
    plan: Plan,
    folder: Path,
    threads: int,
    report: Report,
) -> pd.DataFrame:
    """Plays a split; one row an episode, in the split's order."""
    rows: dict[int, dict[str, Any]] = {}
    with blaming(f"agent({plan.seed}) of method {method.name!r}"):
        agent = method.agent(plan.seed)
    for index, episode in rollout(agent, source, split.cases, threads=threads):
        rows[index] = _row(split, index, episode)
        if index < plan.record and len(episode.actions):
            _record(folder, plan, source, split, index, episode)
        report(len(rows), len(split.cases))
    return pd.DataFrame([rows[index] for index in sorted(rows)])


def _row(split: splits.Split, index: int, episode: Episode) -> dict[str, Any]:
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
    }


def _recording(folder: Path, split: str, index: int) -> Path:
    return folder / "recordings" / f"{split}-{index:04d}.rrd"


def _unrecorded(folder: Path, done: pd.DataFrame, record: int) -> bool:
    """Whether a recording is missing; an episode that failed before its first step has none."""
    wanted = done[(done["row"] < record) & (done["length"] > 0)]
    places = (_recording(folder, split, row) for split, row in zip(wanted["split"], wanted["row"], strict=True))
    return not all(place.exists() for place in places)


def _record(
    folder: Path, plan: Plan, source: setting.Source, split: splits.Split, index: int, episode: Episode
) -> None:
    from dextron_bench import recording

    properties = {
        "method": methods.find(plan.method).name,
        "reaches": plan.reaches,
        "split": split.name,
        "split_digest": split.digest,
        "row": index,
        "seed": plan.seed,
        "physics": model.mjcf_hash(),
    }
    recording.write(_recording(folder, split.name, index), episode, source.path(episode.setting), properties)


def _claim(folder: Path, plan: Plan, method: methods.Method) -> None:
    """Makes the folder this run's, or checks that it is."""
    config = {
        "method": method.name,
        "code": methods.origin(plan.method),
        "settings": methods.settings(method),
        "reaches": plan.reaches,
        "seed": plan.seed,
        "physics": model.mjcf_hash(),
    }
    file = folder / "config.json"
    if not file.exists():  # Written last, so that whoever finds it finds the rest.
        provenance.write_json(folder / "provenance.json", provenance.collect())
        provenance.write_json(file, config)
    found, wanted = read_json(file), json.loads(json.dumps(config))
    if other := [name for name in wanted if found.get(name) != wanted[name]]:
        raise RunMismatch(
            f"{folder} holds a run with other {' and '.join(other)}; remove it, or choose another folder with --runs"
        )


def _stored(folder: Path, wanted: Sequence[splits.Split]) -> pd.DataFrame:
    """Episodes already in the folder, less those of splits that have changed since; raises DamagedRun."""
    file = folder / EPISODES
    if not file.exists():
        return pd.DataFrame()
    try:
        episodes = pd.read_parquet(file)
        now = episodes["split"].map({split.name: split.digest for split in wanted})
        return episodes[now.isna() | (now == episodes["digest"])]
    except (OSError, ValueError, KeyError) as error:
        raise DamagedRun(file, error) from error


def _conclude(folder: Path, plan: Plan, episodes: pd.DataFrame) -> None:
    """Writes the result: every episode's score, from which each row of the leaderboard is computed."""
    scores = {
        name: {
            "digest": rows["digest"].iloc[0],
            "scores": rows["score"].tolist(),
            "failed": int((rows["failure"] != "").sum()),
        }
        for name, rows in episodes.groupby("split", sort=False)
    }
    found = {
        "method": methods.find(plan.method).name,
        "reaches": plan.reaches,
        "seed": plan.seed,
        "splits": scores,
        "provenance": read_json(folder / "provenance.json"),
    }
    provenance.write_json(folder / RESULT, found)
