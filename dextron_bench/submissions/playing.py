"""Plays an entry: an isolated agent on all splits that rank methods, in an order that it does not know."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.isolation.isolated_agent import IsolatedAgent, Limits
from dextron_bench.methods.isolation.launch import Launch
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import result_files
from dextron_bench.runs.evaluation_job import EvaluationJob, Played
from dextron_bench.runs.plans import ENTRANT
from dextron_bench.splits.loading import Split, load_split, ranking_splits
from dextron_bench.storage import folder_config, hashing, provenance
from dextron_bench.storage.pieces import Place, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.submissions import bundle
from dextron_bench.submissions.entry import Entry


def play_entry(
    entry: Entry, runs: Path, record: int, limits: Limits, threads: int = 0, report: Progress = no_progress
) -> Path:
    """Plays the episodes of an entry that the folder of runs lacks; returns the folder of the entry's seeds.

    Raises AgentError if the agent does not start, FolderMismatch if the folder belongs to another entry, MissingData.
    """
    for job in prepare_all(entry, runs, record, limits, threads):

        def report_seed(done: int, total: int, note: str = "", seed: int = job.folder.seed) -> None:
            report(done, total, f"seed {seed}")

        result_files.write_result(job.folder, job.table(report_seed), job.facts)
    return entry.folder(runs)


def prepare_all(entry: Entry, runs: Path, record: int, limits: Limits, threads: int = 0) -> list[EvaluationJob]:
    """The evaluation of each seed of an entry; writes the configs of their folders.

    A piece of an evaluation is a whole split, since its rows are shuffled. Raises BadBundle if a bundle could not hold
    the entry, FolderMismatch, MissingData.
    """
    launch, manifest, files = entry.launch, entry.manifest(), entry.files()
    bundle.check({"format": bundle.FORMAT, **manifest, "files": {}}, "bundle", entry.folder(runs))
    bundle.check_agent(files)
    source = sources.open_source(entry.reaches)
    splits = [load_split(entry.reaches, name) for name in ranking_splits(entry.reaches)]
    hashes = {name: hashing.sha256(file) for name, file in files.items()}
    common = {name: manifest[name] for name in ("agent", "reaches", "physics")} | {"method": entry.name}
    code = provenance.code_hash()

    def job(seed: int) -> EvaluationJob:
        def play(split: Split, rows: range) -> Played:
            return play_shuffled(launch, source, split, seed, limits, threads)

        folder, config = RunFolder.of_seed(entry.folder(runs), seed), {**common, "seed": seed, "files": hashes}
        folder_config.write_or_check(folder.path, config)
        about = {"method": entry.name, "reaches": entry.reaches, "seed": seed}
        arguments = {"entry": entry.in_folder(Path()), "record": record, "limits": limits, "seed": seed}
        made = Recipe(_prepare_again, arguments, entry.reaches, {f"{ENTRANT}/{name}": files[name] for name in files})
        return EvaluationJob(
            folder.path,
            source,
            splits,
            play,
            record,
            about,
            about,
            config,
            code,
            made,
            one_platform=True,
            threads=threads,
        )

    return [job(seed) for seed in entry.seeds]


def _prepare_again(place: Place, entry: Entry, record: int, limits: Limits, seed: int) -> EvaluationJob:
    """The evaluation of a seed of an entry whose files another process has put below the folder of runs."""
    entry = entry.in_folder(place.runs / ENTRANT)
    jobs = prepare_all(entry, place.runs, record, limits, place.threads)
    return next(job for job in jobs if job.folder.seed == seed)


def play_shuffled(
    launch: Launch, source: Source, split: Split, seed: int, limits: Limits, threads: int = 0
) -> Iterator[tuple[int, Any]]:
    """Plays a split with an agent in a separate process, in the order of `row_order`; yields rows and episodes."""
    rows = row_order(split, seed)
    with IsolatedAgent(launch, seed, limits) as agent:
        for place, episode in rollout(agent, source, split.rows(rows), threads=threads):
            yield int(rows[place]), episode


def row_order(split: Split, seed: int) -> np.ndarray:
    """The row numbers of a split in the order in which a submission with this seed plays them."""
    digest = hashing.digest(split.digest.encode(), str(seed).encode())
    return np.random.default_rng(int(digest, 16)).permutation(len(split))


def write_bundle(entry: Entry, folder: Path, file: Path) -> dict[str, Any]:
    """Writes the bundle of an entry whose runs are complete; returns its manifest."""
    return bundle.pack(folder, entry.manifest(), entry.files(), file)
