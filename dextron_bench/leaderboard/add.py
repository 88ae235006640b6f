"""Adds verified submissions to the board: their results, and the episodes that reproduce them."""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from dextron_bench.leaderboard import build, collect
from dextron_bench.leaderboard.submission import bundle, names
from dextron_bench.leaderboard.submission.entry import BadSubmission
from dextron_bench.leaderboard.submission.verdict import Verdict
from dextron_bench.methods import registry
from dextron_bench.runs import run_files
from dextron_bench.storage import atomic
from dextron_bench.storage.run_folder import RunFolder


def check_name(name: str, reaches: str, board: Path, replace: bool) -> None:
    """Raises BadSubmission if a submission must not use a name, or if it is on the board and `replace` is False."""
    if not registry.NAME.fullmatch(name) or len(name) > 64:
        raise BadSubmission(f"{name!r} is not a valid name: use letters, digits and . _ + -, as in 'my-agent'")
    results = board / collect.RESULTS
    rows = {names.appearance(place.name): place for place in results.iterdir()} if results.exists() else {}
    place = rows.get(names.appearance(name))
    taken = place is not None and (place.name != name or not list(place.glob(f"*/{bundle.MANIFEST}")))
    if taken or names.imitated(name, registry.installed_methods()):
        raise BadSubmission(f"{name!r} looks like the name of another row; submit it under another name")
    if place and (place / reaches).exists() and not replace:
        raise BadSubmission(f"{name!r} on {reaches} reaches is on the board; --replace replaces it")


def merge(verdict: Verdict, board: Path) -> list[Path]:
    """Puts a verified submission on the board and builds its tables and page; returns the files that were built.

    A copy of the board is built first: if a submission breaks the page, the board stays as it was.
    """
    with TemporaryDirectory() as folder:
        trial = Path(folder) / board.name
        if board.exists():
            shutil.copytree(board, trial)
        _put(verdict, trial)
        build.build(trial)
    _put(verdict, board)
    return build.build(board)


def _put(verdict: Verdict, board: Path) -> None:
    """Writes the results, tables and manifest of a submission into the results of a board."""
    manifest = verdict.manifest
    place = board / collect.RESULTS / manifest["name"] / manifest["reaches"]
    part = place.with_name(f".{place.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    for seed, result in verdict.results.items():
        run = RunFolder.of_seed(part, seed)
        run.path.mkdir(parents=True)
        run_files.store_episodes(run, verdict.tables[seed])
        atomic.write_json(run.result, {**result, "tier": verdict.tier})
    atomic.write_json(part / bundle.MANIFEST, manifest)
    shutil.rmtree(place, ignore_errors=True)
    part.replace(place)
