"""Compares the recordings of a submission with its episodes as they were played again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode, fingerprint
from dextron_bench.storage.progress import Progress
from dextron_bench.storage.run_folder import RunFolder


class RecordingCheck:
    """The recordings of one seed; `problems` lists the faults of the recordings that were checked."""

    def __init__(
        self, run: RunFolder, claims: Mapping[str, Any], accepted: Mapping[tuple[str, int], str], report: Progress
    ) -> None:
        """Reads the properties of the recordings of a run.

        `claims` are method, source of reaches and seed. `accepted` are further hashes of episodes, by split and row,
        that a recording may have.
        """
        self._run, self._accepted = run, accepted
        self._claims = {name: claims[name] for name in ("method", "seed")}
        self._summaries = dict(self._screened(claims["seed"], report))
        self.problems: list[str] = []

    def check(self, split: str, row: int, episode: Episode) -> None:
        """Compares the recording of a row, if there is one, with its episode."""
        if not (summary := self._summaries.get((split, row))):
            return
        try:
            recorded = recording.read_screened(summary)
        except recording.BrokenRecording as error:
            self.problems.append(str(error).replace(f"{self._run.path}/", ""))
            return
        name = summary.file.name
        hashes = {fingerprint(episode), self._accepted.get((split, row), "")}
        if fingerprint(recorded.episode) not in hashes or recorded.episode.setting != episode.setting:
            self.problems.append(f"recordings/{name} does not hold the episode that its actions give")
        expected = {**self._claims, "split": split, "row": row}
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


def _row_of(file: Path) -> tuple[str, int]:
    """Split and row in the name of a recording."""
    split, _, row = file.stem.rpartition("-")
    return split, int(row)
