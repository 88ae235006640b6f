"""Verified submissions on the board: their results, and the episodes from which these can be derived again."""

from __future__ import annotations

import shutil
from pathlib import Path

from dextron_bench import methods, provenance, records
from dextron_bench.submission import bundle
from dextron_bench.submission.contest import BadSubmission
from dextron_bench.submission.verification import Verdict

RESULTS = "results"


def check_name(name: str, reaches: str, board: Path, replace: bool) -> None:
    """Raises BadSubmission where a row of that name is not the submission's to write."""
    place = board / RESULTS / name
    baseline = place.exists() and not list(place.glob(f"*/{bundle.MANIFEST}"))
    if name in methods.known() or baseline:
        raise BadSubmission(f"{name!r} is a baseline's name; choose another with `dextron-bench submit --name`")
    if (place / reaches).exists() and not replace:
        raise BadSubmission(f"{name!r} on {reaches} reaches is on the board; --replace puts this one in its place")


def merge(verdict: Verdict, folder: Path, board: Path) -> list[Path]:
    """Puts a sound submission, unpacked in a folder, on the board; returns the folders of its results."""
    manifest = verdict.manifest
    place = board / RESULTS / manifest["name"] / manifest["reaches"]
    shutil.rmtree(place, ignore_errors=True)
    made = []
    for seed, result in verdict.results.items():
        own = place / f"seed{seed}"
        own.mkdir(parents=True)
        shutil.copyfile(folder / f"seed{seed}" / records.EPISODES, own / records.EPISODES)
        provenance.write_json(own / records.RESULT, {**result, "tier": verdict.tier})
        made.append(own)
    provenance.write_json(place / bundle.MANIFEST, manifest)  # Last: with it the row is whole.
    return made
