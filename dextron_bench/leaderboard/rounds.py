"""Rounds: rows of a board play fresh settings that nobody could know, the same for all (docs/leaderboard.md).

A round has a folder. Its commitments are written first: hashes of all that will play, and what the beacon will be, a
value that does not exist yet. Settings follow from the commitments and the beacon's value, and ranks from the episodes
on them. The latest round counts; one that is void does not, and stays.
"""

from __future__ import annotations

import hashlib
import secrets
from dataclasses import dataclass
from pathlib import Path

from dextron_bench.errors import BadInput, NotFound
from dextron_bench.experts import montecarlo
from dextron_bench.leaderboard import round_entries
from dextron_bench.splits import fresh
from dextron_bench.splits.loading import Split
from dextron_bench.storage import atomic, hashing, records, tables
from dextron_bench.storage.folders import visible
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.records import Count, Record
from dextron_bench.world import model
from dextron_bench.world.engine import Engine

FOLDER = "rounds"  # In the leaderboard's folder: a folder for each round, named by its number.
ROWS = 500  # Settings of each split; a round has this many or more.
OPERATOR = "operator "  # A beacon that begins so is a secret of the operator's, whose SHA-256 follows.


class Commitments(Record, frozen=True):
    """What is fixed before the settings exist.

    `entries` are hashes of what will play, by method and source, as in `bc/real`; `authors` are who made submissions.
    """

    number: Count
    physics: str
    rows: Count
    beacon: str
    entries: dict[str, str]
    authors: dict[str, str]


class Draw(Record, frozen=True):
    """The value of the beacon, the hash of the commitments, and the digests of the settings by source and split."""

    value: str
    commitments: str
    digests: dict[str, dict[str, str]]


class Void(Record, frozen=True):
    """Why a round does not count."""

    reason: str


@dataclass(frozen=True, slots=True)
class Round:
    """A round of a board, and its files."""

    board: Path
    number: int

    @property
    def folder(self) -> Path:
        """The folder of the round."""
        return self.board / FOLDER / str(self.number)

    @property
    def commitments_file(self) -> Path:
        """The file with what was fixed before the settings existed."""
        return self.folder / "commitments.json"

    @property
    def draw_file(self) -> Path:
        """The file with the value of the beacon."""
        return self.folder / "draw.json"

    @property
    def void_file(self) -> Path:
        """The file with the reason, if the round does not count."""
        return self.folder / "void.json"

    @property
    def episodes_file(self) -> Path:
        """The table of all episodes; it is there when the round is over."""
        return self.folder / "episodes.parquet"

    def settings_file(self, reaches: str) -> Path:
        """The table of the settings on a source."""
        return self.folder / f"settings-{reaches}.parquet"

    @property
    def commitments(self) -> Commitments:
        """What was fixed before the settings existed; raises DamagedFile."""
        return records.read(self.commitments_file, Commitments)

    @property
    def is_void(self) -> bool:
        """True if the round does not count."""
        return self.void_file.exists()

    @property
    def is_over(self) -> bool:
        """True if all episodes were played, or the round is void."""
        return self.is_void or self.episodes_file.exists()

    def seed(self, value: str) -> int:
        """The seed of all settings, from the commitments and the value of the beacon."""
        return int(hashing.digest(self.commitments_file.read_bytes(), value.encode())[:16], 16)

    def splits(self, reaches: str) -> list[Split]:
        """The fresh splits of a source, none without entries; raises NotFound before they are drawn, DamagedFile."""
        if not self.draw_file.exists():
            raise NotFound(f"the settings of round {self.number} are not drawn yet; give the beacon's --value")
        if not (digests := records.read(self.draw_file, Draw).digests.get(reaches)):
            return []
        splits = fresh.from_frame(tables.read_own(file := self.settings_file(reaches), tables.CASES), reaches)
        if {split.name: split.digest for split in splits} != digests:
            raise atomic.OtherForm(file, f"its settings are others than {self.draw_file.name} names")
        return splits


def rounds(board: Path) -> list[Round]:
    """All rounds that were announced, in order."""
    numbers = [folder.name for folder in visible(board / FOLDER, "*") if folder.name.isdecimal()]
    return [Round(board, number) for number in sorted(map(int, numbers))]


def current(board: Path) -> Round:
    """The round that was announced and is not over; raises NotFound."""
    announced = rounds(board)
    if not announced or announced[-1].is_over:
        raise NotFound(f"no round of {board} is announced; `dextron-bench leaderboard announce` does it")
    return announced[-1]


def latest(board: Path) -> Round | None:
    """The round from which ranks follow: the latest one that is over and not void; None before the first."""
    return next((one for one in reversed(rounds(board)) if one.is_over and not one.is_void), None)


def announce(board: Path, beacon: str = "", rows: int = ROWS) -> tuple[Round, str]:
    """Writes the commitments of the next round; returns it, and the operator's secret if no beacon is named.

    All rows that can be run again will play. Raises BadInput if the round before is not over, if an author has more
    than ENTRIES rows, or for few `rows`; NotFound, DamagedFile.
    """
    known = rounds(board)
    if known and not known[-1].is_over:
        raise BadInput(f"round {known[-1].number} is not over: play it, or say with --void why it does not count")
    if rows < ROWS:
        raise BadInput(f"a round has at least {ROWS} settings of each split, not {rows}")
    secret = "" if beacon else secrets.token_hex(16)
    round_ = Round(board, known[-1].number + 1 if known else 1)
    entries, authors = round_entries.of_board(board)
    commitments = Commitments(
        round_.number, model.mjcf_hash(), rows, beacon or OPERATOR + _sha256(secret), entries, authors
    )
    round_.folder.mkdir(parents=True)
    atomic.write_json(round_.commitments_file, commitments)
    return round_, secret


def draw(round_: Round, value: str, threads: int = 0, report: Progress = no_progress) -> None:
    """Draws the settings of all sources that have entries, which takes an hour; raises BadInput, MissingData.

    A source that is drawn already is left as it is.
    """
    commitments = round_.commitments
    if commitments.physics != model.mjcf_hash():
        raise BadInput(f"round {round_.number} was announced for other physics than this version's")
    if commitments.beacon.startswith(OPERATOR) and commitments.beacon != OPERATOR + _sha256(value):
        raise BadInput(f"{value!r} is not the secret whose hash round {round_.number} has announced")
    engine, digests = Engine(montecarlo.SLOTS, threads), {}
    for reaches in sorted({name.partition("/")[2] for name in commitments.entries}):
        if not (file := round_.settings_file(reaches)).exists():
            drawn = fresh.draw(reaches, round_.seed(value), engine, commitments.rows, report)
            tables.write(file, fresh.to_frame(drawn))
        splits = fresh.from_frame(tables.read_own(file, tables.CASES), reaches)
        digests[reaches] = {split.name: split.digest for split in splits}
    sha256 = hashing.sha256(round_.commitments_file)
    atomic.write_json(round_.draw_file, Draw(value, sha256, digests))


def declare_void(round_: Round, reason: str) -> None:
    """Says why a round does not count; its files stay."""
    atomic.write_json(round_.void_file, Void(reason))


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
