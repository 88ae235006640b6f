"""The data set of the success model on a cluster: a task plays one block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from dextron_bench.cluster.inputs import imported_reaches
from dextron_bench.cluster.ray_cluster import RayCluster
from dextron_bench.cluster.tasks import RUNS, Task
from dextron_bench.methods import weights
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits.loading import load_split
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.shares import blocks_needed
from dextron_bench.success import block_pieces, generation, sharing
from dextron_bench.success.generation import DatasetConfig

POLICIES = "policies"  # Folder of their weights below a node's folder of runs.


def play_blocks(
    cluster: RayCluster,
    config: DatasetConfig,
    folder: Path,
    runs: Path,
    rows: int,
    policies: Mapping[str, Path],
    progress: Progress = no_progress,
) -> None:
    """Plays blocks as pieces in the folder of a data set, below `runs`, until they have `rows` transitions.

    `policies` are files of weights by the names that `config` has. At the end, a few blocks more than needed may be
    there; the blocks under way then are cancelled. Raises the errors of `generation.generate` and `RayCluster.run`.
    """
    block_pieces.read(folder, generation.write_or_check_config(folder, config, rows))  # Checks them.
    submitted = set(block_pieces.block_sizes(folder))
    inputs = {f"{RUNS}/{POLICIES}/{name}": file for name, file in policies.items()} | imported_reaches(config.reaches)

    def next_task(under_way: int) -> Task | None:
        number = next(number for number in range(len(submitted) + 1) if number not in submitted)
        if under_way and number >= blocks_needed(list(block_pieces.block_sizes(folder).values()), rows):
            return None
        submitted.add(number)
        arguments = {"config": config, "number": number, "folder": folder.relative_to(runs).as_posix(), "rows": rows}
        return Task(f"block {number:06d}", play_block, arguments, inputs, cluster.threads)

    def is_enough(_: Task | None = None) -> bool:
        done = sharing.transitions(folder)
        progress(min(done, rows), rows)
        return done >= rows

    if not is_enough():
        cluster.run(next_task, is_enough)


def play_block(runs: Path, threads: int, config: DatasetConfig, number: int, folder: str, rows: int) -> Sequence[Path]:
    """Plays a block of a data set; returns its file and its stamp."""
    place = runs / folder
    content = generation.write_or_check_config(place, config, rows)
    agents = {name: weights.load_agent_from_file(runs / POLICIES / name) for name in config.policies}
    train, file = load_split(config.reaches, "train"), block_pieces.file_of(place, number)
    generation.play_block(open_source(config.reaches), train, config, number, agents, threads, file)
    return [file, block_pieces.write_stamp(place, content, number)]
