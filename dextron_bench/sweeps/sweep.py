"""A sweep: what is asked, and the file that holds it with the trials and the winner."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from msgspec import UNSET, UnsetType, to_builtins

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.results import Code
from dextron_bench.methods import registry
from dextron_bench.methods.settings import Settings
from dextron_bench.runs.plans import Plan, resolve
from dextron_bench.splits.loading import load_split
from dextron_bench.splits.names import VAL
from dextron_bench.storage import atomic, folder_config, hashing, records
from dextron_bench.storage.folders import visible
from dextron_bench.storage.records import Count, Record
from dextron_bench.sweeps import optuna_search, space
from dextron_bench.sweeps.space import Choices, Part, Space
from dextron_bench.sweeps.trial import Trial, TrialRecord, best

FOLDER, FILE = "sweeps", "sweep.json"  # In the folder of runs: sweeps/<name>/sweep.json.
CHOICE = "The winner has the highest mean return on val. The sweep has played no other split."


class Question(Record, frozen=True, kw_only=True):
    """Everything that the results of a sweep depend on; `settings` are those that do not vary, `val` is its digest."""

    code: Code
    method: str
    physics: str
    prune: bool
    reaches: str
    sampler: str
    sampler_seed: Count | UnsetType = UNSET
    seeds: list[Count]
    settings: Settings
    space: dict[str, Part]
    val: str


@dataclass(frozen=True)
class Sweep:
    """What a sweep asks: a method with fixed `settings`, and a space of others; one agent for each of `seeds`.

    The sampler "grid" tries every combination of values; "random", "tpe" and "gp" draw trials. Draws depend on
    `sampler_seed`. With `prune`, a training is stopped when its learning curve falls below the median.
    """

    method: str
    reaches: str
    space: Space
    seeds: tuple[int, ...] = (0,)
    settings: Settings = field(default_factory=dict)
    sampler: str = "grid"
    sampler_seed: int = 0
    prune: bool = False

    def plan(self, settings: Settings) -> Plan:
        """The run of a trial, on `val` alone."""
        return Plan(self.method, self.reaches, (VAL,), settings={**self.settings, **settings})

    def question(self) -> Question:
        """Everything that the results depend on, as its file holds it; raises the errors of `resolve`, UnknownSplit."""
        run = resolve(self.plan({}))
        settings = registry.settings_of(run.method).items()
        about = {**run.config(), "settings": {name: value for name, value in settings if name not in self.space}}
        about |= {"space": space.as_records(self.space), "seeds": self.seeds, "prune": self.prune}
        about |= {"sampler": self.sampler, "val": load_split(run.source, VAL).digest}
        about |= {} if self.sampler == "grid" else {"sampler_seed": self.sampler_seed}
        return records.convert(json.loads(atomic.json_text(about)), Question)

    def trials(self, most: int) -> int:
        """The number of trials: all combinations of a grid, or `most`."""
        return len(self._grid()) if self.sampler == "grid" else most

    @property
    def trials_are_independent(self) -> bool:
        """True if no trial depends on what earlier ones scored, so that all can run side by side."""
        return self.sampler in ("grid", "random") and not self.prune

    def propose(self, earlier: list[Trial]) -> Settings:
        """The settings of the next trial; depends on nothing but the question and the earlier trials."""
        number = len(earlier)
        if self.sampler == "grid":
            return self._grid()[number]
        seed = [self.sampler_seed, number]
        if self.sampler == "random":
            return space.draw(self.space, np.random.default_rng(seed))
        return optuna_search.propose(self.space, self.sampler, seed, earlier)

    def _grid(self) -> list[Settings]:
        return space.grid({name: part for name, part in self.space.items() if isinstance(part, Choices)})


def default_name(sweep: Sweep) -> str:
    """The name of a sweep that the user does not name: its method, and the first digits of its question's hash."""
    question = sweep.question()
    return f"{question.method}-{hashing.digest(atomic.json_text(question).encode())[:8]}"


class Winner(Record, frozen=True):
    """The trial that won, by its number, its run, and the split on which it won."""

    trial: Count
    run: str
    split: str


class SweepContent(Record, frozen=True):
    """The content of the file of a sweep; `flags` of `run` are the method and the settings that do not vary."""

    question: Question
    trials: list[TrialRecord]
    winner: Winner | None
    choice: str
    flags: str


@dataclass(frozen=True)
class SweepFile:
    """The file of a sweep."""

    path: Path

    @classmethod
    def of(cls, runs: Path, name: str) -> SweepFile:
        """The file of a sweep by its name; raises BadInput."""
        if not registry.NAME.fullmatch(name):
            raise BadInput(f"{name!r} is no name of a sweep: use letters, digits and . _ + -, as in 'near-and-hold'")
        return cls(runs / FOLDER / name / FILE)

    @property
    def name(self) -> str:
        """The name of the sweep."""
        return self.path.parent.name

    def read(self) -> SweepContent:
        """Its content; raises BadInput if there is none, DamagedFile."""
        if not self.path.exists():
            names = ", ".join(file.name for file in sweep_files(self.path.parents[2])) or "none"
            raise BadInput(f"no sweep is called {self.name!r}; the folder has {names}")
        return records.read(self.path, SweepContent)

    def begin(self, question: Question) -> list[Trial]:
        """The trials so far, none for a new sweep; raises BadInput if the file has another question."""
        if not self.path.exists():
            return []
        content = self.read()
        if names := list(folder_config.differences(to_builtins(content.question), to_builtins(question))):
            raise BadInput(
                f"{self.path.parent} holds another sweep: it differs in {' and '.join(names)}; give another --name"
            )
        return [Trial.of(trial) for trial in content.trials]

    def write(self, question: Question, trials: list[Trial], flags: str) -> None:
        """Replaces the content; `flags` of `run` are the method and the settings that do not vary."""
        number = best(trials)
        winner = None if number is None else Winner(number, trials[number].run, VAL)
        trial_records = [trial.as_record() for trial in trials]
        atomic.write_json(self.path, SweepContent(question, trial_records, winner, CHOICE, flags))


def sweep_files(runs: Path) -> Iterator[SweepFile]:
    """The files of all sweeps below a folder of runs, sorted."""
    return (SweepFile(file) for file in visible(runs, f"{FOLDER}/*/{FILE}"))
