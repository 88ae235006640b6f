"""Adds verified submissions to the board: results, episodes that reproduce them, code, and recordings."""

from __future__ import annotations

import shutil
from pathlib import Path

from msgspec import structs

from dextron_bench.errors import BadInput
from dextron_bench.leaderboard import build, collect, highlights
from dextron_bench.methods import registry
from dextron_bench.runs import run_files
from dextron_bench.storage import atomic, folders
from dextron_bench.storage.folders import visible
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.submissions import bundle, names
from dextron_bench.submissions.verdict import Verdict


def check_name(name: str, reaches: str, board: Path, replace: bool) -> None:
    """Raises BadInput if a submission must not use a name, or if it is on the board and `replace` is False."""
    if not registry.NAME.fullmatch(name) or len(name) > 64:
        raise BadInput(f"{name!r} is not a valid name: use letters, digits and . _ + -, as in 'my-agent'")
    results = board / collect.RESULTS
    rows = {names.appearance(place.name): place for place in visible(results, "*")}
    place = rows.get(names.appearance(name))
    taken = place is not None and (place.name != name or not visible(place, f"*/{bundle.MANIFEST}"))
    if taken or names.imitated(name, registry.installed_methods()):
        raise BadInput(f"{name!r} looks like the name of another row; submit it under another name")
    if place and (place / reaches).exists() and not replace:
        raise BadInput(f"{name!r} on {reaches} reaches is on the board; --replace replaces it")


def merge(verdict: Verdict, board: Path, agent: Path) -> list[Path]:
    """Puts a verified submission on the board and builds its tables and page; returns the files that were built.

    `agent` is the folder with the agent's own files; the board keeps a copy. A success and a failure of the submission
    are recorded beside the board, from its actions, not from its own recordings.

    Results, tables and page change together in one step: whoever reads the board sees it before or after, and if the
    submission breaks the page, or the process dies, it stays as it was. Raises Failed.
    """
    with folders.replacing(board) as part:
        manifest, place = verdict.manifest, _put(verdict, part)
        if agent.is_dir():
            folders.copy_tree(agent, place / bundle.AGENT)
        highlights.record_outcomes(place, manifest.name, manifest.reaches, part.parent / highlights.FOLDER)
        built = [board / file.relative_to(part) for file in build.build(part)]
    return built


def _put(verdict: Verdict, board: Path) -> Path:
    """Writes results, tables and manifest of a submission into a board that nobody reads yet; returns their folder."""
    manifest = verdict.manifest
    place = board / collect.RESULTS / manifest.name / manifest.reaches
    shutil.rmtree(place, ignore_errors=True)
    for seed, result in verdict.results.items():
        run = RunFolder.of_seed(place, seed)
        run.path.mkdir(parents=True)
        run_files.store_episodes(run, verdict.tables[seed])
        atomic.write_json(run.result, structs.replace(result, tier=verdict.tier))
    atomic.write_json(place / bundle.MANIFEST, manifest)
    return place
