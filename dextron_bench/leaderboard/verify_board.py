"""Verifies the published board: replays submissions, runs baselines again, and builds tables and page again."""

from __future__ import annotations

import filecmp
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from msgspec.structs import asdict, replace

from dextron_bench.evaluation.declaration import Declaration
from dextron_bench.evaluation.results import scores_by_split
from dextron_bench.leaderboard import baseline_check, build, round_check, rounds
from dextron_bench.leaderboard.baseline_check import Finding
from dextron_bench.leaderboard.board_rows import Row
from dextron_bench.leaderboard.highlights import FOLDER
from dextron_bench.reaches import sources
from dextron_bench.reaches.recorded.cache import MissingData
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.storage import atomic, hashing, records
from dextron_bench.storage.folders import copy_tree, visible
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import seed_folders
from dextron_bench.submissions import bundle, episode_tables, replay_check
from dextron_bench.submissions.manifest import Manifest

BUILT = (".md", ".csv", ".json", ".html")  # Files that are compared byte by byte; pictures are not.


def check(row: Row, board: Path, count: int = 0, threads: int = 0, report: Progress = no_progress) -> Finding:
    """Verifies a row of a board, and what it played in the latest round.

    Runs a baseline again on `count` rows of each split, drawn at random, 0 for all.
    """
    try:
        if row.run.episodes.exists():
            finding = _replay(row, threads, report)
        else:
            finding = baseline_check.rerun(row.run, row.result, count, threads, report)
        if not finding.problems and (latest := rounds.latest(board)):
            finding.problems += round_check.row_problems(latest, row, count, threads)
    except MissingData as error:
        return Finding("", [f"not checked: {error}"])
    return finding


def stamp(row: Row, finding: Finding) -> bool:
    """Writes tier and hashes of actions into a baseline's result and returns True, if all its rows ran again."""
    if finding.problems or finding.actions.keys() != row.result.splits.keys():
        return False
    splits = {name: replace(split, actions=finding.actions[name]) for name, split in row.result.splits.items()}
    atomic.write_json(row.run.result, replace(row.result, splits=splits, tier="re-run"))
    return True


def differing_files(board: Path) -> list[str]:
    """A line for each built file of the board that differs from a new build of its results."""
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "board"
        copy_tree(board, copy)
        if (recordings := board.resolve().parent / FOLDER).exists():
            (Path(folder) / FOLDER).symlink_to(recordings)  # The page lists the recordings beside the board.
        build.build(copy)
        built = [file for file in visible(copy, "*") if file.suffix in BUILT]
        return [f"{file.name} differs" for file in built if not _same(file, board / file.name)]


def _replay(row: Row, threads: int, report: Progress) -> Finding:
    """Replays the actions of a submission's row."""
    reaches = row.result.reaches
    splits = [load_split(reaches, name) for name in ranking_splits(reaches)]
    table = episode_tables.read(row.run.episodes, splits)
    if faults := list(episode_tables.faults(table, splits)):
        return Finding("", faults)
    replayed = replay_check.replay_table(sources.open_source(reaches), splits, table, threads, report)
    manifest = records.read(row.run.path.parent / bundle.MANIFEST, Manifest)
    declared = Declaration(**asdict(manifest.declared))
    claims = (row.result.method, row.result.reaches, row.result.declared)
    if claims != (manifest.name, manifest.reaches, declared):
        return Finding("", ["its name, reaches or declarations differ from its manifest"])
    problem = _misplaced(row, [f"seed{seed}" for seed in manifest.seeds])
    if problem := problem or _other_code(row.run.path.parent, manifest.files):
        return Finding("", [problem])
    if scores_by_split(replayed.rows) != row.result.splits:
        return Finding("", ["its result differs from its actions, played again", *replayed.differing[:5]])
    return Finding(f"replayed, {replayed.exact} of {replayed.episodes} episodes equal bit for bit")


def _misplaced(row: Row, seeds: Sequence[str]) -> str:
    """Why a submission's row is in the wrong folder or among wrong seeds; empty if folder and seeds are right."""
    claimed = "/".join((row.result.method, row.result.reaches, f"seed{row.result.seed}"))
    if row.run.identity != claimed:
        return f"lies in {row.run.identity}, but is of {row.name}"
    present = sorted(run.path.name for run in seed_folders(row.run.path.parent))
    return "" if present == sorted(seeds) else f"has {', '.join(present)}, but its manifest has {', '.join(seeds)}"


def _other_code(place: Path, hashes: Mapping[str, str]) -> str:
    """Which of the agent's files on the board differs from its manifest; empty if none does."""
    kept = {str(file.relative_to(place)): hashing.sha256(file) for file in visible(place, f"{bundle.AGENT}/*")}
    listed = {name: value for name, value in hashes.items() if name.startswith(f"{bundle.AGENT}/")}
    differing = sorted(name for name in kept | listed if kept.get(name) != listed.get(name))
    return f"its manifest lists another {differing[0]}" if differing else ""


def _same(file: Path, other: Path) -> bool:
    return other.exists() and filecmp.cmp(file, other, shallow=False)
