"""Writes episodes as a Minari data set for offline learning; the only module that imports minari."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import to_builtins

from dextron_bench.errors import BadInput, MissingPackage
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods.agents import Agent
from dextron_bench.reaches.setting import Source
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, provenance
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.world import model, task

if TYPE_CHECKING:
    from gymnasium.envs.registration import EnvSpec
    from minari.data_collector import EpisodeBuffer
    from minari.dataset.minari_storage import MinariStorage

ENVIRONMENT = "dextron_bench/Grasp-v0"
FORMAT = "arrow"  # The format of Minari that needs no further package.
DATA = "data"  # Minari's name for the folder of the data, inside the data set's folder.
NAME = re.compile(r"[\w-]+(/[\w-]+)*-v\d+", re.ASCII)
CONTRIBUTORS = "the dextron-bench contributors"


class MissingMinari(MissingPackage):
    """Minari is not installed; it is an optional dependency."""

    def __init__(self) -> None:
        super().__init__("Minari is not installed; `pip install 'minari[arrow]'` installs it")


@dataclass(frozen=True, slots=True)
class Player:
    """An agent that plays, its name, and plain values that describe it in the data set's metadata."""

    name: str
    agent: Agent
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Export:
    """A data set to write: the episodes of each player in turn on the first `rows` cases of a split.

    `name` is Minari's id of the data set, such as "dextron/real-train-experts-v0".
    """

    name: str
    split: Split
    rows: int
    players: Sequence[Player]
    author: str = CONTRIBUTORS

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise BadInput(f"{self.name!r} names no data set; a name ends in a version, as dextron/my-episodes-v0 does")
        if self.rows < 1 or not self.players:
            raise BadInput("a data set needs at least one row and one player")

    def write(self, source: Source, into: Path, threads: int = 0, progress: Progress = no_progress) -> Path:
        """Plays the episodes and stores them below the folder `into`; returns the data set's folder.

        Writes nothing else, and leaves nothing after an error. Raises MissingMinari, BadInput if the data set already
        exists or a player fails, AgentError.
        """
        folder = into / self.name
        with _atomic_folder(folder) as part:
            storage = _create_storage(part / DATA, self.split.reaches)
            metadata = dict(self._play(storage, source, threads, progress))
            storage.update_episode_metadata([metadata[number] for number in sorted(metadata)])
            storage.update_metadata(self._metadata())
        return folder

    def _play(
        self, storage: MinariStorage, source: Source, threads: int, progress: Progress
    ) -> Iterator[tuple[int, dict[str, Any]]]:
        """Plays and stores every episode; yields its number and its metadata."""
        rows = self.split.first(self.rows)
        with _without_size(storage):
            for place, player in enumerate(self.players):
                for done, (row, episode) in enumerate(rollout(player.agent, source, rows, threads=threads), 1):
                    if episode.failure:
                        raise BadInput(f"{player.name} failed in row {row} of {self.split.name!r}: {episode.failure}")
                    number = place * len(rows) + row
                    storage.update_episodes([_buffer(number, episode)])
                    yield number, {"player": player.name, "row": row} | _episode_metadata(episode)
                    progress(place * len(rows) + done, len(self.players) * len(rows))

    def _metadata(self) -> dict[str, Any]:
        """The data set's metadata: Minari's own keys, and everything that the episodes depend on."""
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
                "provenance": to_builtins(provenance.collect(model.mjcf_hash())),
            },
        }


@contextmanager
def _atomic_folder(folder: Path) -> Iterator[Path]:
    """A temporary folder that becomes `folder` after the block, or is removed after an error; raises BadInput."""
    if folder.exists():
        raise BadInput(f"{folder} already exists; remove it, or choose another --name or --into")
    part = atomic.temporary(folder.absolute())  # Minari fails on relative paths.
    part.mkdir(parents=True)
    try:
        yield part
        part.rename(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _without_size(storage: MinariStorage) -> Iterator[None]:
    """Stops Minari from adding up the sizes of all files after each episode: thousands of episodes take hours."""
    storage.get_size = lambda: 0.0
    yield
    del storage.get_size


def _create_storage(folder: Path, reaches: str) -> MinariStorage:
    """A new data set without episodes; raises MissingMinari."""
    try:
        from minari.dataset.minari_storage import MinariStorage
    except ModuleNotFoundError as error:
        raise MissingMinari from error
    from dextron_bench.world.gym import action_space, observation_space

    return MinariStorage.new(folder, observation_space(), action_space(), environment(reaches), FORMAT)


def environment(reaches: str) -> EnvSpec:
    """The spec from which Gymnasium makes the environment of the episodes."""
    import gymnasium

    return replace(gymnasium.spec(ENVIRONMENT), kwargs={"reaches": reaches})


def _buffer(number: int, episode: Episode) -> EpisodeBuffer:
    """An episode in the form that Minari stores."""
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


def _episode_metadata(episode: Episode) -> dict[str, Any]:
    """The metadata of an episode; the setting is enough to play it again."""
    return {"setting": asdict(episode.setting), "return": episode.score, "is_success": episode.success}


def summary(folder: Path) -> dict[str, Any]:
    """Numbers of episodes, steps and solved episodes of a data set, and its size [MB]."""
    from minari import MinariDataset

    data = MinariDataset(folder / DATA)
    solved = sum(metadata["is_success"] for metadata in data.storage.get_episode_metadata(range(len(data))))
    megabytes = data.storage.metadata["dataset_size"]
    return {"episodes": len(data), "steps": data.total_steps, "solved": solved, "megabytes": megabytes}
