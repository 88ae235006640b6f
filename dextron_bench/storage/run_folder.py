"""The folder of a run, `<runs>/<label>/<reaches>/seed<k>`, and every path in it.

This module is in the lowest layer because training, runs and leaderboard all use run folders.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dextron_bench.storage.folders import visible

SEED = "seed"  # The folder of seed 3 is `seed3`.
WITHOUT = "without"  # In the folder of runs: without/<subject>/<label>/<reaches>/seed<k>.
TRACKING = "tracking-"  # The files of trackers of `training-0+1` are in `tracking-0+1`.


@dataclass(frozen=True, slots=True, order=True)
class RunFolder:
    """The folder of one method, one source of reaches and one seed."""

    path: Path

    @classmethod
    def of(cls, runs: Path, label: str, reaches: str, seed: int) -> RunFolder:
        """The folder of a run below the folder of all runs."""
        return cls.of_seed(source_folder(runs, label, reaches), seed)

    @classmethod
    def of_seed(cls, parent: Path, seed: int) -> RunFolder:
        """The folder of a seed, below the folder of a method's runs on one source, or of a bundle."""
        return cls(parent / f"{SEED}{seed}")

    @property
    def identity(self) -> str:
        """Label, source of reaches and seed as the path has them, such as `rlil-0.1/real/seed0`."""
        return "/".join(self._parts[-3:])

    @property
    def label(self) -> str:
        """The label of the method, as the path has it."""
        return self._parts[-3]

    @property
    def _parts(self) -> tuple[str, ...]:
        """The parts of the path as it is named: links may lead to folders of other names. A link of another name counts
        as the folder that it leads to."""
        named = Path(os.path.abspath(self.path))
        return (named if named.name.startswith(SEED) else named.resolve()).parts

    @property
    def seed(self) -> int:
        """The seed, as the path has it."""
        return int(self.path.name.removeprefix(SEED))

    @property
    def config(self) -> Path:
        """The file with what the run depends on."""
        return self.path / "config.json"

    @property
    def provenance(self) -> Path:
        """The file with code, versions and machine of the run."""
        return self.path / "provenance.json"

    @property
    def times(self) -> Path:
        """The file that says when the run began and ended."""
        return self.path / "times.json"

    @property
    def weights(self) -> Path:
        """The file of the weights that the agent acts with, if its method learns."""
        return self.path / "weights.safetensors"

    @property
    def curve(self) -> Path:
        """The file of the learning curve, if the method learns."""
        return self.path / "curve.json"

    @property
    def left_out(self) -> Path:
        """The file of the scores on the settings of the subject that the training has left out."""
        return self.path / "left-out.json"

    @property
    def episodes(self) -> Path:
        """The file of the table of episodes."""
        return self.path / "episodes.parquet"

    @property
    def result(self) -> Path:
        """The file with the scores of all episodes, from which the leaderboard is computed."""
        return self.path / "result.json"

    @property
    def failure(self) -> Path:
        """The file with the error that ended the last attempt of the run, if it failed."""
        return self.path / "failure.json"

    @property
    def recordings(self) -> Path:
        """The folder of recordings."""
        return self.path / "recordings"

    @property
    def manifest(self) -> Path:
        """The file with the SHA-256 of every recording."""
        return self.path / "recordings.json"

    def recording(self, split: str, row: int) -> Path:
        """The file of the recording of a split's row."""
        return self.recordings / f"{split}-{row:04d}.rrd"


def source_folder(runs: Path, label: str, reaches: str) -> Path:
    """The folder of a method's runs on one source of reaches."""
    return runs / label / reaches


def runs_without(runs: Path, subject: str) -> Path:
    """The folder of runs whose training has left out a subject."""
    return runs / WITHOUT / subject


def run_folders(runs: Path, label: str = "*") -> list[RunFolder]:
    """All run folders below a folder of runs, sorted; `label` selects one method."""
    return sorted(RunFolder(path) for path in visible(runs, f"{label}/*/{SEED}*"))


def seed_folders(parent: Path) -> list[RunFolder]:
    """The run folders of all seeds in a folder, sorted."""
    return sorted(RunFolder(path) for path in visible(parent, f"{SEED}*"))


def below(place: Path, name: str) -> Iterator[RunFolder]:
    """Run folders at or below a place that hold a file of this name, sorted."""
    return (RunFolder(file.parent) for file in visible(place, f"**/{name}"))
