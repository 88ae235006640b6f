"""Takes finished runs into the folder of the leaderboard: results, curves and weights."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection
from pathlib import Path

from msgspec.structs import replace

from dextron_bench.errors import NotFound
from dextron_bench.evaluation.results import Result, RunConfig, SplitScores
from dextron_bench.methods import registry, specs, weights
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.learners import Learner
from dextron_bench.runs import result_files
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.splits.tracks import PLUS
from dextron_bench.storage import atomic, hashing, records
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.training import learning_curve
from dextron_bench.world import model

RESULTS = "results"  # In the leaderboard's folder: a folder of runs without their large files.


def take(runs: Path, board: Path, only: Collection[str] = ()) -> list[Path]:
    """Copies results and curves of finished runs into the leaderboard's folder, and weights beside their methods.

    A run is finished if its result holds all rows of all splits that rank methods. Runs with other physics than this
    version's are left out, and so are others than `only`, if it names labels with a source, such as rl/real, and what
    a learner played on `val`. Returns the folders of results that were written; raises NotFound, DamagedFile,
    UnknownMethod, BadSettings.
    """
    taken = []
    for run in result_files.finished(runs):
        if only and run.path.relative_to(runs).parent.as_posix() not in only:
            continue
        result = result_files.read_result(run.result)
        if result.physics != model.mjcf_hash() or not _is_complete(result):
            continue
        learner = _installed_learner(run, result)
        if result.training:  # Its snapshot was chosen on `val`, whose score would flatter it.
            result = _with_splits(result, lambda name: name != "val")
        if run.curve.exists():
            learning_curve.read(run.curve)  # What is damaged is not copied.
        copy = RunFolder(board / RESULTS / run.path.relative_to(runs))
        before = result_files.read_result(copy.result) if copy.result.exists() else None
        atomic.write_json(copy.result, _with_tier(result, before))
        if run.curve.exists():
            _copy(run.curve, copy.curve)
        if learner is not None:
            if hashing.sha256(run.weights) != _weights(result):
                raise atomic.OtherForm(run.weights, "it is not the file that the result names")
            file = f"seed{result.seed}.safetensors"
            _copy(run.weights, weights.shipped_folder(learner, result.reaches) / file)
        taken.append(copy.path)
    if not taken:
        raise NotFound(
            f"no run in {runs} holds all splits that rank methods, with this version's physics; "
            "`dextron-bench run` makes some"
        )
    return taken


def run_digest(file: Path) -> str:
    """The hash of a published result without what is added later: tier, actions, splits under tracks."""
    result = result_files.read_result(file)
    splits = {name: replace(split, actions=None) for name, split in _plain(result).items()}
    return hashing.digest(atomic.json_text(replace(result, splits=splits, tier="")).encode())


def _with_splits(result: Result, keep: Callable[[str], bool]) -> Result:
    """A result with the splits whose names pass."""
    return replace(result, splits={name: split for name, split in result.splits.items() if keep(name)})


def _plain(result: Result) -> dict[str, SplitScores]:
    """The splits that were not played under a track."""
    return _with_splits(result, lambda name: PLUS not in name).splits


def _is_complete(result: Result) -> bool:
    """True if a result holds all rows of all splits that rank methods, in their present versions."""
    splits = [load_split(result.reaches, name) for name in ranking_splits(result.reaches)]
    scored = {name: (split.digest, len(split.scores)) for name, split in result.splits.items()}
    return all(scored.get(split.name) == (split.digest, len(split)) for split in splits)


def _with_tier(result: Result, before: Result | None) -> Result:
    """A result with what was added to the one that it replaces, if both have the same weights and plain scores."""
    if before is None or _scores(result) != _scores(before):
        return result
    splits = {
        name: replace(split, actions=before.splits[name].actions or split.actions) if name in before.splits else split
        for name, split in result.splits.items()
    }
    splits |= {name: split for name, split in before.splits.items() if PLUS in name and name not in splits}
    return replace(result, splits=splits, tier=before.tier or result.tier)


def _scores(result: Result) -> tuple[dict[str, list[float]], str | None]:
    """The scores of every plain split, and the hash of the weights that reached them."""
    return {name: split.scores for name, split in _plain(result).items()}, _weights(result)


def _weights(result: Result) -> str | None:
    """The SHA-256 of the weights of a result; None if it has none."""
    return result.training.sha256 if result.training else None


def _installed_learner(run: RunFolder, result: Result) -> Learner | None:
    """The learner whose weights ship with a result; None for a method in a file, and for one without own weights.

    Raises DamagedFile, UnknownMethod, BadSettings, AgentError.
    """
    config = records.read(run.config, RunConfig)
    if config.code is None or config.settings is None:
        raise atomic.OtherForm(run.config, f"it lacks {'code' if config.code is None else 'settings'!r}")
    if config.code.sha256 or specs.parse(config.code.name).kind != "module":
        return None  # A config never makes the code of a file run.
    try:
        method = registry.create(config.code.name, config.settings)
    except (registry.BadSettings, AgentError) as error:
        raise AgentError(f"{error} (with the settings in {run.config})") from error
    if (label := registry.label(method)) != result.method:
        raise atomic.OtherForm(run.config, f"it is of {label!r}, and the result is of {result.method!r}")
    return method if isinstance(method, Learner) else None  # A policy transfer has no weights of its own.


def _copy(file: Path, copy: Path) -> None:
    atomic.write_atomically(copy, lambda part: shutil.copyfile(file, part))
