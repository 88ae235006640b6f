"""The search for experts on a cluster: a task plays one block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from dextron_bench.cluster.inputs import imported_reaches
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import Task
from dextron_bench.experts import blocks, montecarlo
from dextron_bench.experts.montecarlo import Search
from dextron_bench.reaches.sources import open_source
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.shares import blocks_needed
from dextron_bench.world.engine import Engine


def play_blocks(
    cluster: RayCluster, search: Search, folder: Path, runs: Path, rows: int, progress: Progress = no_progress
) -> None:
    """Plays blocks as pieces in the folder of a search, below `runs`, until it has `rows` solved rows.

    At the end, a few blocks more than needed may be there, as with shares; the blocks under way then are cancelled.
    `progress` receives numbers of solved rows. Raises the errors of `montecarlo.run` and of `RayCluster.run`.
    """
    blocks.write_or_check(asdict(search), folder)
    blocks.read_pieces(asdict(search), folder)  # Checks them.
    tallies = blocks.update_tallies(folder, {}, pieces=True)
    submitted = set(tallies)
    inputs = imported_reaches(search.reaches)

    def next_task(under_way: int) -> Task | None:
        number = next(number for number in range(len(submitted) + 1) if number not in submitted)
        if under_way and number >= blocks_needed([tally.solved for tally in tallies.values()], rows):
            return None
        submitted.add(number)
        arguments = {"search": search, "number": number, "folder": folder.relative_to(runs).as_posix()}
        return Task(f"block {number:06d}", play_block, arguments, inputs, cluster.threads)

    def is_enough(_: Task | None = None) -> bool:
        nonlocal tallies
        tallies = blocks.update_tallies(folder, tallies, pieces=True)
        progress(blocks.total(tallies).solved, rows)
        return blocks.last_block_needed(tallies, rows) is not None

    if not is_enough():
        cluster.run(next_task, is_enough)


def play_block(runs: Path, threads: int, search: Search, number: int, folder: str) -> Sequence[Path]:
    """Plays a block of a search; returns its file and its stamp."""
    engine = Engine(montecarlo.SLOTS, threads)
    return montecarlo.play_piece(open_source(search.reaches), search, runs / folder, number, engine)
