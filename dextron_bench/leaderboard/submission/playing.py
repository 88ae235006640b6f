"""Trying an agent as a submission: on all splits that rank methods, isolated, in an order that it is not told."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.leaderboard.submission import bundle
from dextron_bench.leaderboard.submission.entry import Entry
from dextron_bench.methods.isolation.isolated_agent import IsolatedAgent, Limits
from dextron_bench.methods.isolation.launch import Launch
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import execution, result_files
from dextron_bench.splits.loading import Split, load_split, ranking_splits
from dextron_bench.storage import folder_config, hashing
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder


def compete(
    entry: Entry,
    runs: Path,
    record: int,
    limits: Limits,
    threads: int = 0,
    report: Progress = no_progress,
) -> Path:
    """Plays all that an entry needs and the folder of runs lacks; returns the folder of its seeds.

    Raises AgentError where the agent cannot be started, FolderMismatch where the folder is another entry's,
    MissingData.
    """
    folder, source = entry.folder(runs), sources.open_source(entry.reaches)
    bundle.check({"format": bundle.FORMAT, **entry.told(), "files": {}}, "bundle", folder)
    bundle.check_agent(entry.files())
    wanted = [load_split(entry.reaches, name) for name in ranking_splits(entry.reaches)]
    for seed in entry.seeds:
        run = RunFolder.of_seed(folder, seed)
        folder_config.write_or_check(run.path, _config(entry, seed))
        about = {"method": entry.name, "reaches": entry.reaches, "seed": seed}

        def play(split: Split, seed: int = seed) -> execution.Played:
            return shuffled(entry.launch, source, split, seed, limits, threads)

        def report_seed(done: int, total: int, note: str = "", seed: int = seed) -> None:
            report(done, total, f"seed {seed}")

        table = execution.evaluate(run, source, wanted, play, record, about, report_seed)
        result_files.write_result(run, table, about)
    return folder


def shuffled(
    how: Launch, source: Source, split: Split, seed: int, limits: Limits, threads: int = 0
) -> Iterator[tuple[int, Any]]:
    """Rows of a split and their episodes, played by an agent in a process of its own in the order of `order`."""
    rows = order(split, seed)
    with IsolatedAgent(how, seed, limits) as agent:
        for place, episode in rollout(agent, source, [split.cases[row] for row in rows], threads=threads):
            yield int(rows[place]), episode


def order(split: Split, seed: int) -> np.ndarray:
    """The rows of a split in the order in which a submission with that seed plays them."""
    mixed = hashing.digest(split.digest.encode(), str(seed).encode())
    return np.random.default_rng(int(mixed, 16)).permutation(len(split.cases))


def failures(folder: Path, seeds: Sequence[int]) -> dict[str, int]:
    """What failed episodes failed of, and how many did."""
    tables = [pd.read_parquet(RunFolder.of_seed(folder, seed).episodes, columns=["failure"]) for seed in seeds]
    told = pd.concat(tables)["failure"].str.replace(r" at step \d+$", "", regex=True)
    return {str(why): int(count) for why, count in told[told != ""].value_counts().items()}


def finish(entry: Entry, folder: Path, file: Path) -> dict[str, Any]:
    """Writes the bundle of an entry whose runs are complete; returns its manifest."""
    return bundle.pack(folder, entry.told(), entry.files(), file)


def _config(entry: Entry, seed: int) -> dict[str, Any]:
    told = entry.told()
    hashes = {name: hashing.sha256(file) for name, file in entry.files().items()}
    return {name: told[name] for name in ("agent", "reaches", "physics")} | {
        "method": entry.name, "seed": seed, "files": hashes
    }  # fmt: skip
