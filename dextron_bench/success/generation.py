"""Generates the data set Upsilon: states, actions, and whether the grasp succeeded in the end (paper, II.E).

Episodes are of three kinds: experts in settings that they solve, uniformly drawn experts in uniformly drawn settings,
and trained policies. They are played in blocks. A block depends only on the config and on its number, so a killed
generation continues with the next block, and memory never holds the whole data set.
"""

from __future__ import annotations

import functools
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import CRITICAL_DISTANCE, GAIN, Case, Expert, ExpertAgent
from dextron_bench.methods import weights
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.reaches.sources import open_source
from dextron_bench.splits.loading import load_split
from dextron_bench.splits.rows import Rows
from dextron_bench.storage import atomic, block_work, folder_config, tensors
from dextron_bench.storage.block_work import BlockWork
from dextron_bench.storage.pieces import Place, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.success import dataset
from dextron_bench.world import model, task

POLICIES = "policies"  # Folder below the runs of another process, with the weights of policies.
KINDS = SOLVED, UNIFORM, POLICY = ("solved", "uniform", "policy")


class BadDatasetConfig(ValueError):
    """A config has values that no data set can have."""


@dataclass(frozen=True)
class DatasetConfig:
    """Config of a data set: equal configs give equal rows.

    Blocks alternate between the kinds. Half of the experts' episodes have experts that solve their setting, and half
    have uniformly drawn experts. If there are `policies`, they play half of all episodes, as in the paper. `policies`
    are names; the policies play in turn. A block has `block` episodes.
    """

    reaches: str = "synthetic"
    seed: int = 0
    policies: tuple[str, ...] = ()
    block: int = 256

    def __post_init__(self) -> None:
        if self.block < dataset.TEST_EVERY or self.seed < 0:
            raise BadDatasetConfig(
                f"a data set needs at least {dataset.TEST_EVERY} episodes in a block, and a seed of 0 or more"
            )

    def kind(self, number: int) -> str:
        """The kind of a block's episodes, one of KINDS."""
        order = (SOLVED, POLICY, UNIFORM, POLICY) if self.policies else (SOLVED, UNIFORM)
        return order[number % len(order)]

    def policy(self, number: int) -> str:
        """Name of the policy that plays a block of kind POLICY."""
        return self.policies[number // 2 % len(self.policies)]


@dataclass(frozen=True, slots=True)
class Tally:
    """Numbers of transitions, episodes and successful episodes in a data set or in a block."""

    rows: int = 0
    episodes: int = 0
    solved: int = 0

    def as_dict(self) -> dict[str, float]:
        """The numbers by name, with the share of episodes that succeed."""
        return {**asdict(self), "success_rate": self.solved / self.episodes if self.episodes else 0.0}

    def __add__(self, other: Tally) -> Tally:
        return Tally(self.rows + other.rows, self.episodes + other.episodes, self.solved + other.solved)


def draw_rows(source: Source, train: Rows, config: DatasetConfig, number: int) -> Rows:
    """The rows that a block plays. All their reaches occur in `train`, the split of that name."""
    rng = np.random.default_rng([config.seed, number])
    if config.kind(number) != UNIFORM:
        return train.rows(rng.integers(len(train), size=config.block).tolist())
    names = frozenset(case.setting.reach for case in train.cases)
    gains, criticals = (rng.uniform(*bounds, config.block).tolist() for bounds in (GAIN, CRITICAL_DISTANCE))
    experts = [Expert(gain, critical) for gain, critical in zip(gains, criticals, strict=True)]
    return Rows(cases=tuple(Case(_draw_setting(source, names, rng), expert, 0.0) for expert in experts))


def open_generation(
    place: Place, config: DatasetConfig, rows: int, policies: Mapping[str, Path] | None = None
) -> Generation:
    """The generation of a data set in a folder. `policies` are files of weights, by the names that the config has.

    Without `policies`, they are where another process has put them. Raises BadWeights, MissingData.
    """
    if policies is None:
        policies = {name: place.runs / POLICIES / name for name in config.policies}
    agents = {name: weights.load_agent_from_file(file) for name, file in policies.items()}
    source, train = open_source(config.reaches), load_split(config.reaches, "train")
    return Generation(config, place.folder, rows, source, train, agents, policies, place.threads)


@dataclass(frozen=True)
class Generation(BlockWork):
    """The generation of a data set of at least `goal` transitions, in a folder.

    `train` is the split of that name. `agents` are the policies by name, and `policies` their files of weights.
    """

    unit, what, suffix = "transitions", "the data set", ".safetensors"

    config: DatasetConfig
    place: Path
    goal: int
    source: Source
    train: Rows
    agents: Mapping[str, Agent]
    policies: Mapping[str, Path] = field(default_factory=dict)
    threads: int = 0

    @property
    def cycle(self) -> int:
        """Number of blocks after which the kinds repeat. A share has whole cycles, so that it sees every kind."""
        return 4 if self.config.policies else 2

    def begin(self) -> None:
        """Writes the config of the data set, or checks that the folder has no other.

        Raises FolderMismatch, BadDatasetConfig.
        """
        if self.goal < 1:
            raise BadDatasetConfig(f"--rows is the number of transitions to generate, 1 or more, not {self.goal}")
        advice = "choose another folder, or remove it"
        folder_config.write_or_check_file(self.place / dataset.CONFIG, self.config_of(""), "data set", advice)

    def config_of(self, name: str) -> dict[str, Any]:
        """What a block depends on, besides its number."""
        return {"search": asdict(self.config), "physics": model.mjcf_hash()}

    def recipe(self, name: str) -> Recipe:
        """How another process makes the same data set."""
        files = {f"{POLICIES}/{policy}": file for policy, file in self.policies.items()}
        return Recipe(open_generation, {"config": self.config, "rows": self.goal}, self.config.reaches, files)

    def amounts(self) -> dict[int, int]:
        """How many transitions each block has, also in pieces."""
        return {number: int(tensors.read_about(file)["rows"]) for number, file in self.block_files().items()}

    def play_blocks(self, numbers: Iterable[int]) -> Iterator[list[Path]]:
        """Plays blocks as pieces; yields the files of each, the stamp last."""
        for number in numbers:
            name = block_work.name_of(number)
            self._play(number, file := self.file(name, self.suffix))
            yield self.complete(name, [file])

    def run(self, progress: Progress = no_progress) -> dict[str, Tally]:
        """Plays blocks until the goal is reached; returns a tally of each kind.

        `progress` receives numbers of transitions. Blocks of shares are checked; the data set gets those that it needs,
        and the others are removed. Raises BadDatasetConfig, FolderMismatch if the folder holds another data set,
        BadDataset if a block is damaged, and the errors of `rollout` and of `stored`.
        """
        self.begin()
        pieces = self.stored()
        tallies, number = {kind: Tally() for kind in KINDS}, 0
        while (done := sum(tally.rows for tally in tallies.values())) < self.goal:
            progress(done, self.goal)
            file, piece = self.block_file(number), pieces.get(block_work.name_of(number))
            if not file.exists() and piece:
                atomic.write_atomically(file, functools.partial(shutil.copyfile, next(iter(piece.files))))
            elif not file.exists():
                self._play(number, file)
            tallies[self.config.kind(number)] += block_tally(file)
            number += 1
        progress(done, self.goal)
        self.remove(pieces.values())
        return tallies

    def _play(self, number: int, file: Path) -> None:
        """Plays the block with a number and writes its file.

        The file has states (R, 48) and actions (R,) as float32, `starts` (E + 1,) and `solved` (E,). Episode k has the
        rows from `starts[k]` to before `starts[k + 1]`, one for each of its actions.
        """
        config = self.config
        agent = self.agents[config.policy(number)] if config.kind(number) == POLICY else ExpertAgent()
        rows = draw_rows(self.source, self.train, config, number)
        played = dict(rollout(agent, self.source, rows, threads=self.threads))
        episodes = [played[row] for row in range(len(rows))]
        solved = np.array([episode.score == task.SUCCESS for episode in episodes], np.uint8)
        arrays = {
            "states": np.concatenate([episode.states[:-1] for episode in episodes]).astype(np.float32),
            "actions": np.concatenate([episode.actions[:, 0] for episode in episodes]).astype(np.float32),
            "starts": np.cumsum([0, *(len(episode.actions) for episode in episodes)]),
            "solved": solved,
        }
        about = {"rows": len(arrays["actions"]), "episodes": len(episodes), "solved": int(solved.sum())}
        tensors.write(file, arrays, about)


def block_tally(file: Path) -> Tally:
    """The tally of a block; raises BadDataset, OSError."""
    arrays = dataset.open_block(file)
    return Tally(len(arrays["actions"]), len(arrays["solved"]), int(arrays["solved"].sum()))


def _draw_setting(source: Source, names: frozenset[str], rng: np.random.Generator) -> Setting:
    """A uniformly drawn setting whose reach is one of `names`."""
    while True:
        setting = source.sample(rng)
        if setting.reach in names:
            return setting
