"""The checks of a board's rows, in pieces (`storage/pieces.py`): a piece is what is found for a row."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from dextron_bench.leaderboard import collect, rounds, verify_board
from dextron_bench.leaderboard.baseline_check import Finding
from dextron_bench.leaderboard.board_rows import Row
from dextron_bench.methods import registry
from dextron_bench.runs import result_files
from dextron_bench.storage import atomic, hashing, provenance, records
from dextron_bench.storage.atomic import Json
from dextron_bench.storage.folders import visible
from dextron_bench.storage.pieces import ListedWork, Place, Recipe
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.world import model

FILE = ".finding"  # Ending of the file of a piece, beside its stamp.
BOARD = "board"  # Folder below the runs of another process, with the files of the row.
NOT_NEEDED = (".rrd",)


@dataclass(frozen=True)
class RowChecks(ListedWork):
    """The checks of some rows of a board, in the folder `place`. `verify_board.check` explains the other fields."""

    place: Path
    board: Path
    rows: Sequence[Row]
    count: int = 0
    threads: int = 0

    def names(self) -> list[str]:
        """The names of all pieces, in the order of the rows."""
        return list(self._rows())

    def title(self, name: str) -> str:
        """The run of a row: method, source of reaches and seed."""
        return self._rows()[name].run.identity

    def config_of(self, name: str) -> dict[str, Json] | None:
        """What a finding depends on: the published files of the row, the code of its method, and the flags."""
        if (row := self._rows().get(name)) is None:
            return None
        files = [file for file in (row.run.result, row.run.episodes) if file.exists()] + self._round_files()
        hashes = {file.name: hashing.sha256(file) for file in files}
        method = row.result.maker.method if row.result.maker else None
        code = registry.package_files(registry.find_method(method)) if method in registry.installed_methods() else []
        about = {"physics": model.mjcf_hash(), "code": provenance.code_hash(*code), "rows": self.count}
        return {**about, "files": hashes}

    def recipe(self, name: str) -> Recipe:
        """How another process makes the check of the piece's row."""
        row = self._rows()[name]
        files = [file for file in visible(row.run.path.parent, "**/*") if file.suffix not in NOT_NEEDED]
        files += self._round_files()
        inputs = {f"{BOARD}/{file.relative_to(self.board).as_posix()}": file for file in files if file.is_file()}
        again = partial(_check_again, identity=row.run.identity, count=self.count)
        return Recipe(again, row.result.reaches, inputs)

    def play(self, name: str, report: Progress = no_progress) -> list[Path]:
        """Checks a row and writes what it finds; returns the files, the stamp last."""
        atomic.write_json(file := self.file(name, FILE), asdict(self._check(self._rows()[name], report)))
        return self.complete(name, [file])

    def findings(self, bar: Callable[[str], AbstractContextManager[Progress]]) -> Iterator[tuple[Row, Finding]]:
        """Each row with what is found, by a piece or now; removes the pieces at the end. Raises DamagedFile.

        `bar` shows the check of a row, by its name.
        """
        stored = self.stored()
        findings = {name: records.read(self.file(name, FILE), Finding) for name in stored}
        for name, row in self._rows().items():
            if name not in findings:
                with bar(row.name) as report:
                    findings[name] = self._check(row, report)
            yield row, findings[name]
        self.remove(stored.values())

    def _rows(self) -> dict[str, Row]:
        """The rows by the names of their pieces."""
        return {row.run.identity.replace("/", "-"): row for row in self.rows}

    def _check(self, row: Row, report: Progress) -> Finding:
        return verify_board.check(row, self.board, self.count, self.threads, report)

    def _round_files(self) -> list[Path]:
        """The files of the latest round; none before the first."""
        latest = rounds.latest(self.board)
        return visible(latest.folder, "*") if latest else []


def _check_again(place: Place, identity: str, count: int) -> RowChecks:
    """The check of a row whose files another process has put below the folder of runs."""
    run = RunFolder(place.runs / BOARD / collect.RESULTS / identity)
    row = Row(run, result_files.read_result(run.result))
    return RowChecks(place.folder, place.runs / BOARD, [row], count, place.threads)
