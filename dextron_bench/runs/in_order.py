"""Scores of a method on the rows of a split in a frozen random order, of stored results or of episodes played now.

Played episodes are kept in `<runs>/sequential/<label>/<reaches>/seed<k>`, so that the same command continues.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pandas as pd

from dextron_bench.evaluation import episode_table
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods import registry
from dextron_bench.reaches import sources
from dextron_bench.runs import execution, run_files
from dextron_bench.runs.plans import Run
from dextron_bench.splits.loading import Split
from dextron_bench.splits.order import random_order
from dextron_bench.storage import folder_config

FOLDER = "sequential"  # Below the folder of all runs.
SLOTS = 16  # Episodes at once: few, because those under way at the end are lost.
KEPT = 64  # Episodes after which the table is stored.


class ScoresInOrder(Protocol):
    """Scores of a method on the first rows of a split in its random order."""

    name: str
    seeds: int
    is_stored: bool  # True if the scores were there before, and no episode is played.

    @property
    def begun(self) -> int:
        """Episodes that were begun, of all seeds together, also in an earlier call of the command."""
        ...

    @property
    def failed(self) -> int:
        """Episodes that the agent failed, or whose simulation diverged."""
        ...

    def first(self, count: int) -> np.ndarray:
        """Scores (seeds, count) of the first `count` rows; plays those that are missing."""
        ...

    def close(self) -> None:
        """Ends the episodes under way and keeps those that ended."""
        ...


class StoredScores:
    """Scores of finished runs."""

    is_stored = True
    begun = failed = 0

    def __init__(self, name: str, scores: np.ndarray, split: Split) -> None:
        self.name, self.seeds = name, len(scores)
        self._scores = scores[:, random_order(split)]

    def first(self, count: int) -> np.ndarray:
        """Scores (seeds, count) of the first `count` rows."""
        return self._scores[:, :count]

    def close(self) -> None:
        """Does nothing: no episode is under way."""


class PlayedScores:
    """Scores of agents, one for each seed, that play the rows in order."""

    is_stored = False

    def __init__(self, runs: Sequence[Run], split: Split, folder: Path, threads: int = 0) -> None:
        self.name, self.seeds = runs[0].label, len(runs)
        self._players = [_Player(run, split, folder / FOLDER, threads) for run in runs]

    @property
    def begun(self) -> int:
        """Episodes that were begun, of all seeds together, also in an earlier call of the command."""
        return sum(player.begun for player in self._players)

    @property
    def failed(self) -> int:
        """Episodes that the agent failed, or whose simulation diverged."""
        return sum(player.failed for player in self._players)

    def first(self, count: int) -> np.ndarray:
        """Scores (seeds, count) of the first `count` rows; plays until they have ended. Raises AgentError."""
        return np.array([player.first(count) for player in self._players])

    def close(self) -> None:
        """Ends the episodes under way and keeps those that ended."""
        for player in self._players:
            player.close()


class _Player:
    """Plays one seed. Later rows may end before earlier ones; scores are given in order."""

    def __init__(self, run: Run, split: Split, runs: Path, threads: int) -> None:
        self._split, self._folder = split, run.folder(runs)
        agent = execution.agent(run, run.plan.weights)  # If this raises, there is no folder yet.
        folder_config.write_or_check(self._folder.path, run.config(), registry.defaults_of(run.method))
        if run.plan.weights:
            run_files.copy_weights(run.plan.weights, self._folder)
        stored = run_files.stored_episodes(self._folder, [split])
        self._others = stored[stored["split"] != split.name] if len(stored) else stored
        rows = stored[stored["split"] == split.name].to_dict("records") if len(stored) else []
        self._rows: dict[int, dict[Any, Any]] = {row["row"]: row for row in rows}
        self._order = random_order(split)
        self._left = [row for row in self._order if row not in self._rows]
        self._kept = self._before = len(self._rows)
        self._episodes: Iterator[tuple[int, Episode]] = rollout(
            agent, sources.open_source(run.source), split.rows(self._left), SLOTS, threads
        )

    @property
    def begun(self) -> int:
        """Episodes that were begun: those that ended, and those in the slots if any was played now."""
        under_way = SLOTS if len(self._rows) > self._before else 0
        return min(len(self._rows) + under_way, len(self._order))

    @property
    def failed(self) -> int:
        """Episodes that the agent failed, or whose simulation diverged."""
        return sum(bool(row["failure"]) for row in self._rows.values())

    def first(self, count: int) -> list[float]:
        """The scores of the first `count` rows."""
        while any(row not in self._rows for row in self._order[:count]):
            place, episode = next(self._episodes)
            row = self._left[place]
            self._rows[row] = episode_table.row(self._split, row, episode)
            if len(self._rows) - self._kept >= KEPT:
                self._store()
        return [self._rows[row]["score"] for row in self._order[:count]]

    def close(self) -> None:
        """Ends the rollout and stores the episodes that ended."""
        self._episodes = iter(())
        self._store()

    def _store(self) -> None:
        if len(self._rows) > self._kept:
            played = pd.DataFrame([self._rows[row] for row in sorted(self._rows)])
            run_files.store_episodes(self._folder, pd.concat([self._others, played], ignore_index=True))
            self._kept = len(self._rows)
