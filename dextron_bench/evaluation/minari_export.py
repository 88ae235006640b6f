"""Episodes as a Minari data set, which offline learners load; the only importer of minari."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import Split
from dextron_bench.storage import provenance
from dextron_bench.world import model, task

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage

ENVIRONMENT = "dextron_bench/Grasp-v0"
FORMAT = "arrow"  # Of Minari's formats the one that needs no further package.
DATA = "data"  # Minari's name for a data set's folder below that of its name.
NAME = re.compile(r"[\w-]+(/[\w-]+)*-v\d+", re.ASCII)
CONTRIBUTORS = "the dextron-bench contributors"

Report = Callable[[int, int], None]  # Told (episodes, episodes wanted).


class MissingMinari(ImportError):
    """Minari is an extra."""

    def __init__(self) -> None:
        super().__init__("Minari is not installed; `pip install 'minari[arrow]'` brings it")


class BadExport(ValueError):
    """A data set that cannot be."""


@dataclass(frozen=True, slots=True)
class Player:
    """Who acts, by a name, and what is known of it: plain values."""

    name: str
    agent: Agent
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Export:
    """What a data set holds: every player's episodes on the first `rows` cases of a split, player after player.

    `name` is Minari's id of it, as "dextron/real-train-experts-v0".
    """

    name: str
    split: Split
    rows: int
    players: Sequence[Player]
    author: str = CONTRIBUTORS

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise BadExport(
                f"{self.name!r} names no data set; a name ends in a version, as dextron/my-episodes-v0 does"
            )
        if self.rows < 1 or not self.players:
            raise BadExport("a data set needs at least one row, and somebody who plays it")

    def write(self, source: Source, into: Path, threads: int = 0, report: Report = lambda done, wanted: None) -> Path:
        """Plays the episodes and stores them below the folder `into`; returns the data set's own folder.

        Nothing else is written, and after an error nothing of it is left. Raises MissingMinari, BadExport where the
        data set is there already or a player fails, and what `rollout` does.
        """
        folder = into / self.name
        with _whole(folder) as part:
            storage = _new(part / DATA, self.split.reaches)
            told = dict(self._play(storage, source, threads, report))
            storage.update_episode_metadata([told[number] for number in sorted(told)])
            storage.update_metadata(self._about())
        return folder

    def _play(
        self, storage: MinariStorage, source: Source, threads: int, report: Report
    ) -> Iterator[tuple[int, dict[str, Any]]]:
        """Stores every episode, and yields its number and what is told of it."""
        cases = self.split.cases[: self.rows]
        with _unweighed(storage):
            for place, player in enumerate(self.players):
                for done, (row, episode) in enumerate(rollout(player.agent, source, cases, threads=threads), 1):
                    if episode.failure:
                        raise BadExport(f"{player.name} failed in row {row} of {self.split.name!r}: {episode.failure}")
                    number = place * len(cases) + row
                    storage.update_episodes([_buffer(number, episode)])
                    yield number, {"player": player.name, "row": row} | _told(episode)
                    report(place * len(cases) + done, len(self.players) * len(cases))

    def _about(self) -> dict[str, Any]:
        """The data set's metadata: Minari's own keys, and beside them all that the episodes depend on."""
        import minari

        split, names = self.split, ", ".join(player.name for player in self.players)
        return {
            "dataset_id": self.name,
            "minari_version": minari.__version__,
            "algorithm_name": names,
            "author": {self.author},
            "description": f"Episodes of {names} on the split {split.name!r} of {split.reaches} reaches.",
            "requirements": ["dextron-bench"],
            "ref_min_score": 0.0,
            "ref_max_score": task.SUCCESS,
            "dextron_bench": {
                "split": {"reaches": split.reaches, "name": split.name, "digest": split.digest, "rows": self.rows},
                "players": [{"name": player.name, **player.about} for player in self.players],
                "provenance": provenance.collect(model.mjcf_hash()),
            },
        }


@contextmanager
def _whole(folder: Path) -> Iterator[Path]:
    """A folder to fill that takes its place when all went well, and else is gone; raises BadExport."""
    if folder.exists():
        raise BadExport(f"{folder} is there already; remove it, or choose another --name or --into")
    part = folder.absolute().with_name(f".{folder.name}.{os.getpid()}.part")  # Minari loses its way on relative paths.
    part.mkdir(parents=True)
    try:
        yield part
        os.rename(part, folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _unweighed(storage: MinariStorage) -> Iterator[None]:
    """Keeps Minari from adding up all files after each episode, which takes hours of thousands of episodes."""
    storage.get_size = lambda: 0.0
    yield
    del storage.get_size


def _new(folder: Path, reaches: str) -> MinariStorage:
    """An empty data set; raises MissingMinari."""
    try:
        from minari.dataset.minari_storage import MinariStorage
    except ModuleNotFoundError as error:
        raise MissingMinari from error
    from dextron_bench.world.gym import action_space, observation_space

    return MinariStorage.new(folder, observation_space(), action_space(), environment(reaches), FORMAT)


def environment(reaches: str) -> EnvSpec:
    """How Gymnasium makes the environment in which the episodes were played."""
    import gymnasium

    return replace(gymnasium.spec(ENVIRONMENT), kwargs={"reaches": reaches})


def _buffer(number: int, episode: Episode) -> EpisodeBuffer:
    """An episode as Minari takes it."""
    from minari.data_collector import EpisodeBuffer

    ends = np.arange(len(episode.actions)) == len(episode.actions) - 1
    arrays: dict[str, Any] = {
        "observations": episode.states,
        "actions": episode.actions,
        "rewards": episode.rewards,
        "terminations": ends & episode.terminated,
        "truncations": ends & episode.truncated,
    }
    return EpisodeBuffer(id=number, **arrays)


def _told(episode: Episode) -> dict[str, Any]:
    """An episode's own metadata, by which it can be played again."""
    return {"setting": asdict(episode.setting), "return": episode.score, "is_success": episode.success}


def summary(folder: Path) -> dict[str, Any]:
    """How much a data set holds."""
    from minari import MinariDataset

    found = MinariDataset(folder / DATA)
    told, megabytes = found.storage.get_episode_metadata(range(len(found))), found.storage.metadata["dataset_size"]
    solved = sum(each["is_success"] for each in told)
    return {"episodes": len(found), "steps": found.total_steps, "solved": solved, "megabytes": megabytes}
