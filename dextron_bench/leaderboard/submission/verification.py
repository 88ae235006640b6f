"""Checking a submission: nothing that it says is believed that its actions, played again, do not show."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from dextron_bench.leaderboard.submission import duplicates
from dextron_bench.leaderboard.submission.seed_check import Report, Seed
from dextron_bench.leaderboard.submission.verdict import Verdict
from dextron_bench.methods.isolation import sandbox
from dextron_bench.methods.isolation.isolated_agent import Limits
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.world import model


def verify(
    folder: Path,
    manifest: dict[str, Any],
    board: Path | None = None,
    rerun: bool = False,
    threads: int = 0,
    limits: Limits | None = None,
    report: Report = lambda what, done, total: None,
) -> Verdict:
    """Checks an unpacked bundle (see `bundle.unpack`) against the splits, the engine and the results on a board.

    With `rerun` the agent is also run again, from the files in the bundle. Raises MissingData, OSError.
    """
    verdict = Verdict(manifest)
    if manifest["physics"] != model.mjcf_hash():
        verdict.problems.append("was played with other physics than this version's; submit it again with this version")
        return verdict
    if sorted(manifest["seeds"]) != list(range(len(manifest["seeds"]))):
        verdict.problems.append(f"has seeds {manifest['seeds']}; they must be 0, 1, 2 and so on, none chosen")
    wanted = [load_split(manifest["reaches"], name) for name in ranking_splits(manifest["reaches"])]
    seeds = [Seed(folder, manifest, seed, wanted, verdict) for seed in manifest["seeds"]]
    for each in seeds:
        each.check(threads, report)
    if unasked := sorted(set(_seeds(folder)) - set(manifest["seeds"])):
        verdict.problems.append(f"seed{unasked[0]} is there, but not among the seeds that it claims")
    if rerun and verdict.sound:
        _rerun(folder, seeds, verdict, lambda seed: seed.rerun(limits or Limits(), threads, report))
    if len(verdict.results) > 1 and duplicates.all_equal(verdict.results):
        verdict.notes.append("all seeds have the same episodes: they count as one, not as several trainings")
    if board is not None and verdict.sound:
        same = list(duplicates.found(verdict.results, manifest["name"], board))
        (verdict.notes if rerun else verdict.problems).extend(same)
    return verdict


def _rerun(folder: Path, seeds: Sequence[Seed], verdict: Verdict, again: Callable[[Seed], None]) -> None:
    """Runs the agent of each seed again, where it finds nothing of what it is to do."""
    for place in folder.glob("seed*"):
        shutil.rmtree(place)
    for each in seeds:
        again(each)
    verdict.tier = "re-run" if verdict.sound else "replayed"
    if not sandbox.is_here():
        verdict.notes.append("bubblewrap is not here: the agent ran with your rights, watched by a hook alone")


def _seeds(folder: Path) -> list[int]:
    return [int(place.name.removeprefix("seed")) for place in folder.glob("seed*")]
