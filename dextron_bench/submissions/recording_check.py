"""Compares the recordings of a submission with its episodes as they were played again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode, fingerprint
from dextron_bench.storage.progress import Progress
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.world import model


class RecordingCheck:
    """The recordings of one seed; `problems` lists the faults of the recordings that were checked."""

    def __init__(self, run: RunFolder, method: str, tolerance: float, report: Progress) -> None:
        """Reads the properties of the recordings of a run.

        The run is of a `method`. `tolerance` is the largest difference of a position [m, rad] from the replayed
        episode; 0 accepts equal bits only.
        """
        self._run, self._tolerance = run, tolerance
        self._claims = {"method": method, "seed": run.seed}
        self._summaries = dict(self._screened(run.seed, report))
        self.problems: list[str] = []

    def check(self, split: str, row: int, episode: Episode, cause: str) -> None:
        """Compares the recording of a row, if there is one, with its episode and the cause in the row."""
        if not (summary := self._summaries.get((split, row))):
            return
        try:
            recorded = recording.read_screened(summary)
        except recording.BrokenRecording as error:
            self.problems.append(str(error).replace(f"{self._run.path}/", ""))
            return
        name = summary.file.name
        if not _is_same(recorded.episode, episode, self._tolerance):
            self.problems.append(f"recordings/{name} does not hold the episode that its actions give")
        expected = {**self._claims, "split": split, "row": row}
        expected |= {"cause": cause} if "cause" in recorded.properties else {}  # Not in recordings of version 0.1.
        if differing := [key for key, value in expected.items() if recorded.properties.get(key) != value]:
            key = differing[0]
            self.problems.append(f"recordings/{name} says {key} {recorded.properties.get(key)}, not {expected[key]}")

    def without_row(self, rows: Iterable[tuple[str, int]]) -> list[str]:
        """Names of recordings that belong to none of these rows, sorted by split and row."""
        return [self._summaries[place].file.name for place in sorted(self._summaries.keys() - set(rows))]

    def _screened(self, seed: int, report: Progress) -> Iterator[tuple[tuple[str, int], recording.Summary]]:
        files = sorted(self._run.recordings.glob("*.rrd"))
        for done, summary in enumerate(recording.screen(files), start=1):
            yield _row_of(summary.file), summary
            report(done, len(files), f"seed {seed}, recordings")


def _is_same(recorded: Episode, replayed: Episode, tolerance: float) -> bool:
    """True if two episodes are equal bit for bit, or, on another platform, their positions within the tolerance."""
    if recorded.setting != replayed.setting:
        return False
    if fingerprint(recorded) == fingerprint(replayed):
        return True
    if not tolerance or recorded.states.shape != replayed.states.shape:
        return False
    equal = [np.array_equal(getattr(recorded, name), getattr(replayed, name)) for name in ("actions", "rewards")]
    distances = np.abs(recorded.states - replayed.states)[:, : len(model.initial_qpos())]
    return all(equal) and bool((distances <= tolerance).all())


def _row_of(file: Path) -> tuple[str, int]:
    """Split and row in the name of a recording."""
    split, _, row = file.stem.rpartition("-")
    return split, int(row)
