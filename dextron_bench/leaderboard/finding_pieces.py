"""What shares of a verification of the board find: a piece for each row of the board (`storage/shares.py`)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from dextron_bench.leaderboard import fresh_baselines
from dextron_bench.leaderboard.baseline_check import Finding
from dextron_bench.leaderboard.verify_board import Row
from dextron_bench.methods import registry
from dextron_bench.storage import atomic, hashing, provenance, records, shares
from dextron_bench.world import model

FILE = ".finding"  # Ending of the file of a piece, beside its stamp.


@dataclass(frozen=True)
class FindingPieces:
    """The findings of shares in a folder. `flags` are those on which a finding depends."""

    folder: Path
    board: Path
    flags: dict[str, Any]

    def write(self, row: Row, finding: Finding) -> list[Path]:
        """Writes the finding of a row; returns its files, the stamp last."""
        name = _name(row)
        file = self._work.file(name, FILE)
        atomic.write_json(file, asdict(finding))
        return [file, self._work.write(name, self.config_of(row), [file])]

    def read(self, rows: Sequence[Row]) -> dict[str, shares.Piece]:
        """The pieces that are there, by the identity of the row's run; raises the errors of `shares.Work.read`."""
        if not self._work.is_begun:
            return {}
        configs = {_name(row): self.config_of(row) for row in rows}
        pieces = self._work.read(configs.get)
        return {row.run.identity: pieces[_name(row)] for row in rows if _name(row) in pieces}

    def remove(self, pieces: Iterable[shares.Piece]) -> None:
        """Removes pieces."""
        self._work.remove(pieces)

    @property
    def _work(self) -> shares.Work:
        return shares.Work(self.folder, provenance.code_hash())

    def config_of(self, row: Row) -> dict[str, Any]:
        """What a finding depends on: the published files of the row, the code of its method, and the flags."""
        fresh = [self.board / fresh_baselines.FOLDER / f"{row.result.reaches}{end}" for end in (".json", ".parquet")]
        files = {file.name: file for file in (row.run.result, row.run.episodes, row.run.fresh, *fresh) if file.exists()}
        hashes = {name: hashing.sha256(file) for name, file in files.items()}
        method = row.result.maker.method if row.result.maker else None
        code = registry.package_files(registry.find_method(method)) if method in registry.installed_methods() else []
        return {"physics": model.mjcf_hash(), "files": hashes, "code": provenance.code_hash(*code), **self.flags}


def finding_of(piece: shares.Piece) -> Finding:
    """The finding of a piece; raises DamagedFile."""
    return records.read(next(iter(piece.files)), Finding)


def _name(row: Row) -> str:
    """The name of a row's piece."""
    return row.run.identity.replace("/", "-")
