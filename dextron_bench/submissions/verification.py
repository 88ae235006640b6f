"""Verifies a submission: every claim must follow from its actions when they are played again.

`verify` has more than 25 lines because it lists all checks in their order.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from dextron_bench.methods.isolation import sandbox
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.storage.run_folder import seed_folders
from dextron_bench.submissions import duplicates
from dextron_bench.submissions.manifest import Manifest
from dextron_bench.submissions.seed_check import Playing, SeedCheck
from dextron_bench.submissions.verdict import Verdict
from dextron_bench.world import model


def verify(
    folder: Path,
    manifest: Manifest,
    board: Path | None = None,
    how: Playing | None = None,
    rerun: bool = False,
) -> Verdict:
    """Checks an unpacked bundle (see `bundle.unpack`) against the splits, the engine and the results on a board.

    With `rerun` the agent also runs again, from the files in the bundle, and in the sandbox only unless `how` trusts
    it. Raises MissingData, OSError.
    """
    how, verdict, numbers = how or Playing(), Verdict(manifest), manifest.seeds
    if manifest.physics != model.mjcf_hash():
        verdict.problems.append("was played with other physics than this version's; submit it again with this version")
        return verdict
    if sorted(numbers) != list(range(len(numbers))):
        verdict.problems.append(f"has seeds {numbers}; they must be 0, 1, 2 and so on, none chosen")
    splits = [load_split(manifest.reaches, name) for name in ranking_splits(manifest.reaches)]
    seeds = [SeedCheck(folder, manifest, seed, splits) for seed in numbers]
    for seed in seeds:
        verdict.add(seed.check(how.threads, how.report))
    if extra := sorted({run.seed for run in seed_folders(folder)} - set(numbers)):
        verdict.problems.append(f"holds seed{extra[0]}, which is not among the seeds that its manifest lists")
    if rerun and verdict.passed:
        _rerun(folder, seeds, verdict, how)
    _check_copies(verdict, board)
    return verdict


def _check_copies(verdict: Verdict, board: Path | None) -> None:
    """Adds a note if all seeds are equal, and a problem for copied episodes; only a note if the agent was re-run."""
    if len(verdict.results) > 1 and duplicates.all_equal(verdict.results):
        verdict.notes.append("all seeds have the same episodes: they count as one, not as several trainings")
    if board is not None and verdict.passed:
        copies = list(duplicates.copied_seeds(verdict.results, verdict.manifest.name, board))
        (verdict.notes if verdict.tier == "re-run" else verdict.problems).extend(copies)


def _rerun(folder: Path, seeds: Sequence[SeedCheck], verdict: Verdict, how: Playing) -> None:
    """Runs the agent of each seed again; removes its recorded episodes first, so that the agent cannot read them.

    Only a run in the sandbox gives the tier `re-run`: without it, the agent may read the splits and their experts.
    """
    for run in seed_folders(folder):
        shutil.rmtree(run.path)
    for seed in seeds:
        verdict.add(seed.rerun(how))
    if not sandbox.is_available():
        verdict.notes.append("the agent ran again without a sandbox, with your rights: its tier stays `replayed`")
    elif verdict.passed:
        verdict.tier = "re-run"
