"""Takes finished runs into the folder of the leaderboard: results, curves and weights."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from dextron_bench.methods import registry, weights
from dextron_bench.methods.learners import Learner
from dextron_bench.runs import result_files, run_files
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.storage import atomic
from dextron_bench.training.jobs import CURVE

RESULTS = "results"  # In the leaderboard's folder: a folder of runs less their large files.


class NothingToPublish(LookupError):
    """A folder of runs none of which is finished."""


def take(runs: Path, into: Path) -> list[Path]:
    """Copies results and curves of finished runs into the leaderboard's folder, and weights beside their methods.

    A run is finished when its result holds all rows of all splits that rank methods. Returns the folders of results
    that were written; raises NothingToPublish, DamagedFile, UnknownMethod, BadSettings.
    """
    taken = []
    for file in sorted(runs.glob(f"*/*/seed*/{result_files.RESULT}")):
        result = result_files.read_result(file)
        if not _finished(result):
            continue
        place = into / RESULTS / file.parent.relative_to(runs)
        known = place / result_files.RESULT
        atomic.write_json(known, _checked(result, result_files.read_result(known)) if known.exists() else result)
        if (found := file.with_name(CURVE)).exists():
            _copy(found, place / CURVE)
        _ship(file.parent, result)
        taken.append(place)
    if not taken:
        raise NothingToPublish(f"no run in {runs} holds all splits that rank methods; `dextron-bench run` makes some")
    return taken


def _finished(result: dict[str, Any]) -> bool:
    wanted = [load_split(result["reaches"], name) for name in ranking_splits(result["reaches"])]
    have = {name: (found["digest"], len(found["scores"])) for name, found in result["splits"].items()}
    return all(have.get(split.name) == (split.digest, len(split.cases)) for split in wanted)


def _checked(result: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    """A result with what verification noted in the one before it, where both say the same of every episode."""
    told = [{name: split["scores"] for name, split in each["splits"].items()} for each in (result, before)]
    hashes = [(each.get("training") or {}).get("sha256") for each in (result, before)]
    if told[0] != told[1] or hashes[0] != hashes[1] or "tier" not in before:
        return result
    noted = {name: before["splits"][name].get("actions") for name in result["splits"]}
    parts = {
        name: split | ({"actions": noted[name]} if noted[name] else {}) for name, split in result["splits"].items()
    }
    return {**result, "splits": parts, "tier": before["tier"]}


def _ship(folder: Path, result: dict[str, Any]) -> None:
    """Puts an installed learner's weights where `eval` finds them; those of a file's stay with whose they are."""
    config = atomic.read_json(folder / run_files.CONFIG)
    if config["code"]["sha256"]:
        return
    method = registry.create(config["code"]["class"], config["settings"])
    if isinstance(method, Learner):  # A method that takes the policy of another has no weights of its own.
        _copy(folder / weights.FILE, weights.place(method, result["reaches"]) / f"seed{result['seed']}.safetensors")


def _copy(file: Path, place: Path) -> None:
    atomic.write_atomically(place, lambda part: shutil.copyfile(file, part))
