"""Verified submissions on the board: their results, and the episodes from which these can be derived again."""

from __future__ import annotations

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from dextron_bench.leaderboard import build, collect
from dextron_bench.leaderboard.submission import bundle
from dextron_bench.leaderboard.submission.entry import BadSubmission
from dextron_bench.leaderboard.submission.verdict import Verdict
from dextron_bench.methods import registry
from dextron_bench.runs import result_files, run_files
from dextron_bench.storage import atomic


def check_name(name: str, reaches: str, board: Path, replace: bool) -> None:
    """Raises BadSubmission where a row of that name is not the submission's to write."""
    if not registry.NAME.fullmatch(name):
        raise BadSubmission(f"{name!r} is no name: use letters, digits and . _ + -, as in 'my-agent'")
    results = board / collect.RESULTS
    rows = {place.name.casefold(): place for place in results.iterdir()} if results.exists() else {}
    place = rows.get(name.casefold())
    ours = place is not None and (place.name != name or not list(place.glob(f"*/{bundle.MANIFEST}")))
    if ours or name.casefold().split("-")[0] in registry.known():
        raise BadSubmission(f"{name!r} is or begins like the name of a row that is not yours; submit it under another")
    if place and (place / reaches).exists() and not replace:
        raise BadSubmission(f"{name!r} on {reaches} reaches is on the board; --replace puts this one in its place")


def merge(verdict: Verdict, board: Path) -> list[Path]:
    """Puts a sound submission on the board and makes its tables and page again; returns the files that were made.

    All is made beside the board first, so that a submission from which no page can be made leaves it as it was.
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
    manifest = verdict.manifest
    place = board / collect.RESULTS / manifest["name"] / manifest["reaches"]
    part = place.with_name(f".{place.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    for seed, result in verdict.results.items():
        own = part / f"seed{seed}"
        own.mkdir(parents=True)
        run_files.store(own, verdict.tables[seed])
        atomic.write_json(own / result_files.RESULT, {**result, "tier": verdict.tier})
    atomic.write_json(part / bundle.MANIFEST, manifest)
    shutil.rmtree(place, ignore_errors=True)
    part.replace(place)
