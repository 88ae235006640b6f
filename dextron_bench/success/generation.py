"""The data set Upsilon: what hands did in which states, and whether the grasp succeeded in the end (paper, II.E).

Episodes are of three kinds: experts in settings that they solve, experts drawn uniformly in settings drawn uniformly,
and trained policies. They are played in blocks that depend on their number alone, so that a data set can be killed
and taken up again, and is never in memory as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import blocks
from dextron_bench.experts import policies as experts_policies
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.storage import tensors
from dextron_bench.success import dataset
from dextron_bench.world import task

KINDS = SOLVED, UNIFORM, POLICY = ("solved", "uniform", "policy")

Report = Callable[[int, int], None]  # Told (rows, rows wanted).


class BadDatasetConfig(ValueError):
    """A data set that cannot be."""


@dataclass(frozen=True)
class DatasetConfig:
    """Which data set: equal ones hold equal rows.

    The kinds of blocks go round, so that half of the experts' episodes are drawn from those that solve their setting
    and half uniformly, and where there are `policies` half of all episodes are theirs, as in the paper. `policies`
    name who plays, in turn; a block has `block` episodes.
    """

    reaches: str = "synthetic"
    seed: int = 0
    policies: tuple[str, ...] = ()
    block: int = 256

    def __post_init__(self) -> None:
        if self.block < dataset.TEST_EVERY or self.seed < 0:
            raise BadDatasetConfig(
                f"a data set needs at least {dataset.TEST_EVERY} episodes a block, and a seed of 0 or more"
            )

    def kind(self, number: int) -> str:
        """What the episodes of a block are."""
        order = (SOLVED, POLICY, UNIFORM, POLICY) if self.policies else (SOLVED, UNIFORM)
        return order[number % len(order)]

    def player(self, number: int) -> str:
        """Which policy plays a block of kind POLICY."""
        return self.policies[number // 2 % len(self.policies)]


@dataclass(frozen=True, slots=True)
class Tally:
    """What a data set holds, or a block of it: transitions, episodes, and those that succeed."""

    rows: int = 0
    episodes: int = 0
    solved: int = 0

    def as_dict(self) -> dict[str, float]:
        """Its numbers by name, with the share of episodes that succeed."""
        return {**asdict(self), "success_rate": self.solved / self.episodes if self.episodes else 0.0}

    def __add__(self, other: Tally) -> Tally:
        return Tally(self.rows + other.rows, self.episodes + other.episodes, self.solved + other.solved)


def draw_cases(source: Source, train: Sequence[Case], collection: DatasetConfig, number: int) -> list[Case]:
    """What the episodes of a block are played on: nothing but reaches of `train`, the cases of that split."""
    rng = np.random.default_rng([collection.seed, number])
    if collection.kind(number) != UNIFORM:
        return [train[row] for row in rng.integers(len(train), size=collection.block)]
    known = frozenset(case.setting.reach for case in train)
    gains, criticals = (
        rng.uniform(*bounds, collection.block) for bounds in (experts_policies.GAIN, experts_policies.CRITICAL_DISTANCE)
    )
    pairs = zip(gains.tolist(), criticals.tolist(), strict=True)
    return [Case(_sample(source, known, rng), Expert(gain, critical), 0.0) for gain, critical in pairs]


def generate(
    source: Source,
    train: Sequence[Case],
    collection: DatasetConfig,
    folder: Path,
    rows: int,
    agents: Mapping[str, Agent],
    threads: int = 0,
    report: Report = lambda done, wanted: None,
) -> dict[str, Tally]:
    """Plays blocks until there are so many rows; returns what there is of each kind.

    `agents` are the policies by name. Raises BadDatasetConfig, FolderMismatch where the folder holds another data set,
    BadDataset where a block is damaged, and what `rollout` does.
    """
    if rows < 1:
        raise BadDatasetConfig(f"--rows is how many transitions there are to be, 1 or more, not {rows}")
    blocks.claim(asdict(collection), folder)
    tallies, number = {kind: Tally() for kind in KINDS}, 0
    while (done := sum(tally.rows for tally in tallies.values())) < rows:
        report(done, rows)
        file, kind = block_file(folder, number), collection.kind(number)
        if not file.exists():
            agent = agents[collection.player(number)] if kind == POLICY else ExpertAgent()
            _play(source, draw_cases(source, train, collection, number), agent, threads, file)
        tallies[kind] += block_tally(file)
        number += 1
    report(done, rows)
    return tallies


def block_file(folder: Path, number: int) -> Path:
    """Where a block is stored."""
    return folder / "blocks" / f"{number:06d}.safetensors"


def block_tally(file: Path) -> Tally:
    """What a block holds; raises BadDataset, OSError."""
    found = dataset.open_block(file)
    return Tally(len(found["actions"]), len(found["solved"]), int(found["solved"].sum()))


def _play(source: Source, cases: Sequence[Case], agent: Agent, threads: int, file: Path) -> None:
    """Plays a block and stores it: states (R, 48) and actions (R,) float32, `starts` (E + 1,), `solved` (E,).

    Episode k has the rows from `starts[k]` to `starts[k + 1]`, one for each of its actions.
    """
    played = dict(rollout(agent, source, cases, threads=threads))
    episodes = [played[k] for k in range(len(cases))]
    solved = np.array([episode.score == task.SUCCESS for episode in episodes], np.uint8)
    arrays = {
        "states": np.concatenate([episode.states[:-1] for episode in episodes]).astype(np.float32),
        "actions": np.concatenate([episode.actions[:, 0] for episode in episodes]).astype(np.float32),
        "starts": np.cumsum([0, *(len(episode.actions) for episode in episodes)]),
        "solved": solved,
    }
    told = {"rows": len(arrays["actions"]), "episodes": len(episodes), "solved": int(solved.sum())}
    tensors.write(file, arrays, told)


def _sample(source: Source, known: frozenset[str], rng: np.random.Generator) -> Setting:
    """A uniform setting of one of the known reaches."""
    while True:
        setting = source.sample(rng)
        if setting.reach in known:
            return setting
