"""Trying an agent as a submission: on all splits that rank methods, isolated, in an order that it is not told."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.leaderboard.submission import bundle
from dextron_bench.leaderboard.submission.declaration import Declaration
from dextron_bench.methods import registry as methods
from dextron_bench.methods.isolation.isolated_agent import Isolated, Launch, Limits, launch
from dextron_bench.reaches import sources
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import execution as run
from dextron_bench.runs import run_files as records
from dextron_bench.splits import loading as splits
from dextron_bench.storage import hashing
from dextron_bench.world import model

FOLDER = "submissions"  # In the folder of runs.
CODE = re.compile(r"(?!exec:)[A-Za-z0-9][\w.+-]*:[A-Za-z_]\w*", re.ASCII)  # In a file that was brought, or a module.
POLICY = re.compile(r"[A-Za-z0-9][\w.+-]*\.(?:pt|onnx)", re.ASCII)


class BadSubmission(ValueError):
    """What cannot be submitted; the message says what would be right."""


def settle(spec: str, text: str, reaches: str) -> dict[str, Any]:
    """An agent's settings from JSON; of an installed method all, as it is made for a source of reaches.

    Raises BadSubmission, BadSettings.
    """
    found = _read(text)
    return methods.settings(methods.create(spec, found, reaches)) if spec in methods.known() else found


def _read(text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except ValueError as error:
        raise BadSubmission(f"--settings is no JSON ({error})") from error
    if not isinstance(found, dict):
        raise BadSubmission("settings are a JSON object, like '{\"near\": 0.05}'")
    return found


@dataclass(frozen=True, slots=True)
class Entry:
    """What is submitted: an agent by the words that name it, on a source of reaches, with seeds."""

    name: str
    spec: str
    reaches: str
    seeds: tuple[int, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    weights: Path | None = None
    declared: Declaration = field(default_factory=Declaration)

    def __post_init__(self) -> None:
        if self.name.casefold().split("-")[0] in methods.known():
            raise BadSubmission(f"the name {self.name!r} begins like that of an installed method; choose another")
        if sorted(self.seeds) != list(range(len(self.seeds))):
            raise BadSubmission("seeds are 0, 1, 2 and so on, so that nobody chooses the best: --seed 0 1 2")
        if not methods.NAME.fullmatch(self.name) or len(self.name) > 64:
            raise BadSubmission(
                f"the name {self.name!r} is not one: use up to 64 letters, digits and . _ + -, as in 'my-agent'"
            )

    @property
    def launch(self) -> Launch:
        """What starts the agent's process."""
        return launch(self.spec, self.settings, self.weights)

    def folder(self, runs: Path) -> Path:
        """Where the runs of its seeds lie."""
        return runs / FOLDER / self.name / self.reaches

    def told(self) -> dict[str, Any]:
        """What its manifest says of it."""
        how = self.launch
        spec = self.spec if how.kind == "method" or how.command else f"{Path(how.spec).name}"
        agent = {"kind": how.kind or "exec", "spec": spec, "settings": self.settings}
        agent["weights"] = self.weights.name if self.weights else ""
        told = {"name": self.name, "reaches": self.reaches, "seeds": list(self.seeds), "agent": agent}
        return {**told, "declared": asdict(self.declared), "physics": model.mjcf_hash()}

    def files(self) -> dict[str, Path]:
        """The agent's own files, that it can be run again from, by name."""
        place, _, _ = self.launch.spec.rpartition(":")
        code = [Path(place)] if self.launch.kind == "code" and place.endswith(".py") else []
        policy = [Path(self.launch.spec)] if self.launch.kind == "policy" else []
        return {file.name: file for file in (*code, *policy, *([self.weights] if self.weights else []))}


def launch_of(told: Mapping[str, Any], files: Path) -> Launch:
    """How to start the agent that a manifest tells of, from the files that it brought alone.

    Raises BadBundle, AgentError.
    """
    kind, spec = told["kind"], told["spec"]
    if kind == "exec":
        raise bundle.BadBundle("an agent that is a program of its own cannot be run again from its bundle")
    if not {"method": methods.known().__contains__, "code": CODE.fullmatch, "policy": POLICY.fullmatch}[kind](spec):
        raise bundle.BadBundle(f"{spec!r} names no agent of kind {kind!r}")
    weights = _own(files, told["weights"]) if told["weights"] else None
    name, _, inside = spec.partition(":")
    if kind == "policy" or name.endswith(".py"):
        spec = ":".join([str(_own(files, name)), *([inside] if inside else [])])
    return launch(spec, told["settings"], weights)


def _own(files: Path, name: str) -> Path:
    if Path(name).name != name or not (files / name).is_file():
        raise bundle.BadBundle(f"the bundle lacks the agent's file {name}")
    return files / name


Report = Callable[[int, int, str], None]  # Told (episodes done, all of a split, which seed).


def compete(
    entry: Entry,
    runs: Path,
    record: int,
    limits: Limits,
    threads: int = 0,
    report: Report = lambda *_: None,
) -> Path:
    """Plays all that an entry needs and the folder of runs lacks; returns the folder of its seeds.

    Raises AgentError where the agent cannot be started, FolderMismatch where the folder is another entry's,
    MissingData.
    """
    folder, source = entry.folder(runs), sources.open_source(entry.reaches)
    bundle.check({"format": bundle.FORMAT, **entry.told(), "files": {}}, "bundle", folder)
    bundle.check_agent(entry.files())
    wanted = [splits.load(entry.reaches, name) for name in splits.evaluated(entry.reaches)]
    for seed in entry.seeds:
        place = folder / f"seed{seed}"
        records.claim(place, _config(entry, seed))
        about = {"method": entry.name, "reaches": entry.reaches, "seed": seed}

        def play(split: splits.Split, seed: int = seed) -> run.Played:
            return shuffled(entry.launch, source, split, seed, limits, threads)

        def told(done: int, total: int, seed: int = seed) -> None:
            report(done, total, f"seed {seed}")

        episodes = run.evaluate(place, source, wanted, play, record, about, told)
        records.conclude(place, episodes, about)
    return folder


def shuffled(
    how: Launch, source: Source, split: splits.Split, seed: int, limits: Limits, threads: int = 0
) -> Iterator[tuple[int, Any]]:
    """Rows of a split and their episodes, played by an agent in a process of its own in the order of `order`."""
    rows = order(split, seed)
    with Isolated(how, seed, limits) as agent:
        for place, episode in rollout(agent, source, [split.cases[row] for row in rows], threads=threads):
            yield int(rows[place]), episode


def order(split: splits.Split, seed: int) -> np.ndarray:
    """The rows of a split in the order in which a submission with that seed plays them."""
    mixed = hashing.digest(split.digest.encode(), str(seed).encode())
    return np.random.default_rng(int(mixed, 16)).permutation(len(split.cases))


def failures(folder: Path, seeds: Sequence[int]) -> dict[str, int]:
    """What failed episodes failed of, and how many did."""
    tables = [pd.read_parquet(folder / f"seed{seed}" / records.EPISODES, columns=["failure"]) for seed in seeds]
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
