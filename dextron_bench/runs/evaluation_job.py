"""The evaluation of one run: its episodes on splits, played at once or in pieces (`storage/pieces.py`).

A piece is some rows of a split, or the whole split if the agent does not promise that its rows are independent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from dextron_bench.evaluation import episode_table
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import annotations, recording_files, run_files
from dextron_bench.runs.recorder import Recorder
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, provenance, schemas, tables
from dextron_bench.storage.pieces import ForeignPiece, ListedWork, Piece, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder

ROWS = 128  # In a piece. With other numbers, pieces of different versions do not fit together.
TABLE = ".parquet"  # Ending of a piece's table of episodes.
Played = Iterator[tuple[int, Episode]]  # Rows and their episodes, as these end.


@dataclass(frozen=True, slots=True)
class RowPiece:
    """Some rows of a split."""

    split: Split
    rows: range

    @property
    def name(self) -> str:
        """The name of the piece, such as `test-0000-0127`: the split, the first row and the last."""
        return f"{self.split.name}-{self.rows[0]:04d}-{self.rows[-1]:04d}"


@dataclass(frozen=True)
class EvaluationJob(ListedWork):
    """The episodes of a run on splits, in the folder `place`.

    `play_rows` plays rows of a split and yields (row, episode) as episodes end. The first `record` rows of each split
    are recorded, with `about` among their properties. `facts` are what the result says of the run. `config` is what the
    episodes depend on besides split and rows, and `code_hash` the hash of the code. `made` is how another process makes
    the same evaluation. With `rows_are_independent`, any rows may be played together. With `one_platform`, pieces of
    different platforms do not fit together. At most `threads` processes write recordings; 0 means one for each
    processor.
    """

    place: Path
    source: Source
    splits: Sequence[Split]
    play_rows: Callable[[Split, range], Played]
    record: int
    about: dict[str, Any]
    facts: dict[str, Any]
    config: Mapping[str, Any]
    code_hash: str
    made: Recipe
    rows_are_independent: bool = False
    one_platform: bool = False
    threads: int = 0

    @property
    def folder(self) -> RunFolder:
        """The folder of the run."""
        return RunFolder(self.place)

    @property
    def code(self) -> str:
        """The SHA-256 of the code that plays episodes, the method's too."""
        return self.code_hash

    def pieces(self) -> dict[str, RowPiece]:
        """All pieces by name, in order; they do not depend on what is done already."""
        return {piece.name: piece for split in self.splits for piece in self._pieces_of(split)}

    def names(self) -> list[str]:
        """The names of all pieces, in order."""
        return list(self.pieces())

    def title(self, name: str) -> str:
        """A piece with the run that it belongs to."""
        return f"{self.folder.identity}/{name}"

    def config_of(self, name: str) -> dict[str, Any] | None:
        """What the files of a piece depend on; None if the evaluation has no such piece."""
        if (piece := self.pieces().get(name)) is None:
            return None
        return {**self.config, "split": piece.split.digest, "recorded episodes": self._recorded(piece.rows)}

    def recipe(self, name: str) -> Recipe:
        """How another process makes the same evaluation."""
        return self.made

    def done(self) -> set[str]:
        """Names of the pieces whose episodes are in the folder; raises the errors of `stored`, and DamagedFile."""
        table = run_files.stored_episodes(self.folder, self.splits)
        complete = {split.name for split in self.splits if self._is_stored(split, table)}
        return {name for name, piece in self.pieces().items() if piece.split.name in complete} | self.stored().keys()

    def play(self, name: str, report: Progress = no_progress) -> list[Path]:
        """Plays a piece and writes its files; returns them, the stamp last. `report` receives episodes.

        An error that ends it is written into the folder of the run.
        """
        piece = self.pieces()[name]
        with annotations.noting_failure([self.folder]):
            rows, recordings = self._play(piece.split, piece.rows, report)
            tables.write(table := self.file(name, TABLE), pd.DataFrame(rows))
            return self.complete(name, [table, *recordings])

    def table(self, report: Progress = no_progress) -> pd.DataFrame:
        """The table of episodes; plays what the folder lacks, and stores the table after each split.

        Pieces in the folder are checked, put into the table and then removed. Raises the errors of `stored`.
        """
        table, pieces = run_files.stored_episodes(self.folder, self.splits), self.stored()
        left = [split for split in self.splits if not self._is_stored(split, table)]
        if pieces:
            self._write_provenance(pieces, left)
        for split in left:
            rows = self._rows_of_split(split, pieces, report)
            table = _with_split(table, split.name, rows)
            run_files.store_episodes(self.folder, table)
        self.remove(pieces.values())
        return table

    def _pieces_of(self, split: Split) -> list[RowPiece]:
        size = ROWS if self.rows_are_independent else len(split)
        starts = range(0, len(split), size)
        return [RowPiece(split, range(start, min(start + size, len(split)))) for start in starts]

    def _is_stored(self, split: Split, table: pd.DataFrame) -> bool:
        """True if the table has a split's episodes, and the folder has their recordings."""
        stored = table[table["split"] == split.name] if len(table) else table
        return len(stored) == len(split) and not recording_files.any_missing(self.folder, stored, self.record)

    def _rows_of_split(self, split: Split, pieces: dict[str, Piece], report: Progress) -> list[dict[str, Any]]:
        """The rows of all episodes of a split, in order: from its pieces, and played where there are none."""
        names = [part.name for part in self._pieces_of(split)]
        missing = [name for name in names if name not in pieces]
        if missing == names:
            rows, recordings = self._play(split, range(len(split)), report)
            self._add_to_manifest(recordings)
            return rows
        for name in missing:
            self.play(name, report)
        if missing:
            pieces |= self.stored()
        return [row for name in names for row in self._rows_of_piece(name, pieces[name])]

    def _rows_of_piece(self, name: str, piece: Piece) -> list[dict[str, Any]]:
        """The rows of a piece; adds its recordings to the manifest. Raises DamagedFile."""
        file = self.file(name, TABLE)
        table = tables.read_own(file, tables.EPISODES)
        self._add_to_manifest({place: sha256 for place, sha256 in piece.files.items() if place != file})
        return [{str(key): value for key, value in row.items()} for row in table.to_dict("records")]

    def _recorded(self, rows: range) -> int:
        return sum(row < self.record for row in rows)

    def _add_to_manifest(self, recordings: Mapping[Path, str]) -> None:
        if recordings:
            recording_files.add_to_manifest(self.folder, {file.name: sha256 for file, sha256 in recordings.items()})

    def _play(self, split: Split, rows: range, report: Progress) -> tuple[list[dict[str, Any]], dict[Path, str]]:
        """Plays rows of a split; returns their rows of the table, in order, and the SHA-256 of their recordings."""
        played: dict[int, dict[str, Any]] = {}
        with Recorder(self.source, self._recorded(rows), self.threads) as recorder:
            for row, episode in self.play_rows(split, rows):
                played[row] = episode_table.row(split, row, episode)
                if row < self.record and len(episode.actions):
                    about = recording_files.properties(split, row, self.about, played[row]["cause"])
                    recorder.write(self.folder.recording(split.name, row), split.case(row), episode, about)
                report(len(played), len(rows))
            recordings = recorder.hashes()
        return [played[row] for row in sorted(played)], recordings

    def _write_provenance(self, pieces: Mapping[str, Piece], left: Sequence[Split]) -> None:
        """Replaces the run's provenance by the provenance of all that make it: pieces, earlier episodes, this process.

        It is written before the episodes, so that a merge that was killed ends with the same bytes. Raises
        ForeignPiece.
        """
        makers = [piece.provenance for piece in pieces.values()]
        if self.folder.episodes.exists() or self.folder.curve.exists():
            makers.append(schemas.read(self.folder.provenance, schemas.PROVENANCE))
        if any(part.name not in pieces for split in left for part in self._pieces_of(split)):
            makers.append(provenance.collect(self.config["physics"]))
        merged = provenance.merged(makers)
        if self.one_platform and "others" in merged:
            self._check_platform(merged)
            del merged["others"]
        atomic.write_json(self.folder.provenance, merged)

    def _check_platform(self, merged: dict[str, Any]) -> None:
        """Raises ForeignPiece if some makers have another platform than the first."""
        platforms = {provenance.platform_of(maker) for maker in (merged, *merged["others"])}
        if len(platforms) > 1:
            raise ForeignPiece(
                f"{self.folder.path} has pieces of different platforms: {' and '.join(sorted(platforms))}; it may name "
                "one only: play all pieces on machines of one kind"
            )


def _with_split(table: pd.DataFrame, split: str, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """The table with other rows of a split, at its end."""
    others = [table[table["split"] != split]] if len(table) else []
    return pd.concat([*others, pd.DataFrame(rows)], ignore_index=True)
