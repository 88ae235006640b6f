"""Takes finished runs into the folder of the leaderboard: results, curves and weights."""

from __future__ import annotations

import json
import shutil
from collections.abc import Collection
from pathlib import Path
from typing import Any

from dextron_bench.methods import registry, specs, weights
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.learners import Learner
from dextron_bench.runs import result_files
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.splits.tracks import PLUS
from dextron_bench.storage import atomic, hashing, provenance, schemas
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.world import model

STAMPED = ("tier", "fresh")  # What verifications add to a result. Splits under tracks can be added, too.
RESULTS = "results"  # In the leaderboard's folder: a folder of runs without their large files.


class NothingToPublish(LookupError):
    """A folder of runs without a finished one."""


def take(runs: Path, board: Path, only: Collection[str] = ()) -> list[Path]:
    """Copies results and curves of finished runs into the leaderboard's folder, and weights beside their methods.

    A run is finished if its result holds all rows of all splits that rank methods. Runs with other physics than this
    version's are left out, and so are others than `only`, if it names labels with a source, such as rl/real, and what
    a learner played on `val`. Returns the folders of results that were written; raises NothingToPublish, DamagedFile,
    UnknownMethod, BadSettings.
    """
    taken = []
    for run in result_files.finished(runs):
        if only and run.path.relative_to(runs).parent.as_posix() not in only:
            continue
        result = result_files.read_result(run.result)
        if provenance.physics_of(result) != model.mjcf_hash() or not _is_complete(result):
            continue
        learner = _installed_learner(run, result)
        if result.get("training"):  # Its snapshot was chosen on `val`, whose score would flatter it.
            result = {**result, "splits": {name: split for name, split in result["splits"].items() if name != "val"}}
        if run.curve.exists():
            schemas.read(run.curve, schemas.CURVE)  # What is damaged is not copied.
        copy = RunFolder(board / RESULTS / run.path.relative_to(runs))
        before = result_files.read_result(copy.result) if copy.result.exists() else {}
        atomic.write_json(copy.result, _with_tier(result, before))
        if run.curve.exists():
            _copy(run.curve, copy.curve)
        if learner is not None:
            if hashing.sha256(run.weights) != (result.get("training") or {}).get("sha256"):
                raise atomic.OtherForm(run.weights, "it is not the file that the result names")
            file = f"seed{result['seed']}.safetensors"
            _copy(run.weights, weights.shipped_folder(learner, result["reaches"]) / file)
        taken.append(copy.path)
    if not taken:
        raise NothingToPublish(
            f"no run in {runs} holds all splits that rank methods, with this version's physics; "
            "`dextron-bench run` makes some"
        )
    return taken


def run_digest(file: Path) -> str:
    """The hash of a published result without what is added later: tier, fresh scores, actions, splits under tracks."""
    result = result_files.read_result(file)
    plain = {name: split for name, split in result["splits"].items() if PLUS not in name}
    splits = {name: {key: split[key] for key in split if key != "actions"} for name, split in plain.items()}
    kept = {key: result[key] for key in result if key not in STAMPED}
    return hashing.digest(json.dumps({**kept, "splits": splits}, sort_keys=True).encode())


def _is_complete(result: dict[str, Any]) -> bool:
    """True if a result holds all rows of all splits that rank methods, in their present versions."""
    splits = [load_split(result["reaches"], name) for name in ranking_splits(result["reaches"])]
    scored = {name: (split["digest"], len(split["scores"])) for name, split in result["splits"].items()}
    return all(scored.get(split.name) == (split.digest, len(split)) for split in splits)


def _with_tier(result: dict[str, Any], before: dict[str, Any]) -> dict[str, Any]:
    """A result with what was added to the one that it replaces, if both have the same plain scores."""
    if not before or _scores(result) != _scores(before):
        return result
    known = before["splits"]
    hashes = {name: known[name].get("actions") for name in result["splits"] if name in known}
    splits = {
        name: split | ({"actions": hashes[name]} if hashes.get(name) else {})
        for name, split in result["splits"].items()
    }
    splits |= {name: split for name, split in known.items() if PLUS in name and name not in splits}
    kept = {name: before[name] for name in STAMPED if name in before}
    return {**result, "splits": splits, **kept}


def _scores(result: dict[str, Any]) -> tuple[dict[str, list[float]], str | None]:
    """The scores of every plain split, and the hash of the weights that reached them."""
    scores = {name: split["scores"] for name, split in result["splits"].items() if PLUS not in name}
    return scores, (result.get("training") or {}).get("sha256")


def _installed_learner(run: RunFolder, result: dict[str, Any]) -> Learner | None:
    """The learner whose weights ship with a result; None for a method in a file, and for one without own weights.

    Raises DamagedFile, UnknownMethod, BadSettings, AgentError.
    """
    config = schemas.read(run.config, schemas.METHOD_CONFIG)
    if config["code"]["sha256"] or specs.parse(config["code"]["class"]).kind != "module":
        return None  # A config never makes the code of a file run.
    try:
        method = registry.create(config["code"]["class"], config["settings"])
    except (registry.BadSettings, AgentError) as error:
        raise AgentError(f"{error} (with the settings in {run.config})") from error
    if (label := registry.label(method)) != result["method"]:
        raise atomic.OtherForm(run.config, f"it is of {label!r}, and the result is of {result['method']!r}")
    return method if isinstance(method, Learner) else None  # A policy transfer has no weights of its own.


def _copy(file: Path, copy: Path) -> None:
    atomic.write_atomically(copy, lambda part: shutil.copyfile(file, part))
