"""Rounds: rows of a board play fresh settings that nobody could know, the same for all (docs/leaderboard.md).

A round has a folder. Its commitments are written first: hashes of all that will play, and what the beacon will be, a
value that does not exist yet. Settings follow from the commitments and the beacon's value, and ranks from the episodes
on them. The latest round counts; one that is void does not, and stays.
"""

from __future__ import annotations

import secrets
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import pandas as pd

from dextron_bench.errors import BadInput, NotFound
from dextron_bench.experts import montecarlo
from dextron_bench.leaderboard import board_rows
from dextron_bench.leaderboard.board_rows import Row
from dextron_bench.methods import registry
from dextron_bench.reaches import setting
from dextron_bench.reaches.sources import RankedSource
from dextron_bench.splits import fresh
from dextron_bench.splits.loading import Split, cases_from_frame, split_digest
from dextron_bench.storage import atomic, hashing, records, tables
from dextron_bench.storage.folders import visible
from dextron_bench.storage.progress import Progress, no_progress
from dextron_bench.storage.records import Count, Record
from dextron_bench.submissions import bundle, names
from dextron_bench.submissions.manifest import Manifest
from dextron_bench.world import model
from dextron_bench.world.engine import Engine

FOLDER = "rounds"  # In the leaderboard's folder: a folder for each round, named by its number.
ROWS = 500  # Settings of each split; a round has this many or more.
ENTRIES = 3  # Rows of one author in a round.
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
        splits = from_frame(tables.read_own(file := self.settings_file(reaches), tables.CASES), reaches)
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
    entries, authors = _entries(board)
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
            tables.write(file, to_frame(drawn))
        splits = from_frame(tables.read_own(file, tables.CASES), reaches)
        digests[reaches] = {split.name: split.digest for split in splits}
    sha256 = hashing.sha256(round_.commitments_file)
    atomic.write_json(round_.draw_file, Draw(value, sha256, digests))


def declare_void(round_: Round, reason: str) -> None:
    """Says why a round does not count; its files stay."""
    atomic.write_json(round_.void_file, Void(reason))


def rows_of(round_: Round) -> list[Row]:
    """The rows of the board that play a round, as they were announced.

    Raises BadInput if one of them was changed since, NotFound, DamagedFile.
    """
    entries = round_.commitments.entries
    by_name = rows_by_name(round_.board)
    for name, announced in entries.items():
        if name not in by_name or entry_hash(by_name[name]) != announced:
            raise BadInput(f"{name} is not what round {round_.number} has announced; it cannot play in it")
    return [row for name in entries for row in by_name[name]]


def entry_hash(rows: list[Row]) -> str:
    """The hash of what plays as a row on one source: of a submission its manifest, of a baseline code and weights."""
    first = rows[0]
    manifest = first.run.path.parent / bundle.MANIFEST
    if manifest.exists():
        return hashing.sha256(manifest)
    maker = first.result.maker
    assert maker is not None
    code = [file.read_bytes() for file in registry.package_files(registry.find_method(maker.method))]
    weights = [row.result.training.sha256 for row in rows if row.result.training]
    about = atomic.json_text({"method": maker.method, "settings": maker.settings, "weights": weights})
    return hashing.digest(about.encode(), *code)


def can_play(row: Row) -> bool:
    """True if a row can be run again: a baseline that ships, or a submission that was run again in the sandbox."""
    if row.run.episodes.exists():
        return row.result.tier == "re-run"
    return row.result.maker is not None and row.result.maker.method in registry.installed_methods()


def learns(rows: list[Row]) -> bool:
    """True if what plays as a row was trained: a learner, or a submission that does not declare a rule."""
    manifest = rows[0].run.path.parent / bundle.MANIFEST
    if manifest.exists():
        return not records.read(manifest, Manifest).declared.rule
    return any(row.result.training for row in rows)


def rows_by_name(board: Path) -> Mapping[str, list[Row]]:
    """The rows of a board on sources that rank, by method and source, as in `bc/real`; their seeds in order."""
    by_name: dict[str, list[Row]] = defaultdict(list)
    for row in board_rows.rows(board, reaches=get_args(RankedSource)):
        by_name[f"{row.result.method}/{row.result.reaches}"].append(row)
    return by_name


def to_frame(splits: list[Split]) -> pd.DataFrame:
    """A table of fresh settings, from which `from_frame` makes the splits again."""
    return pd.concat([_frame(split) for split in splits], ignore_index=True)


def from_frame(table: pd.DataFrame, reaches: str) -> list[Split]:
    """The fresh splits in a table with the columns of a setting, `split`, `gain` and `critical`."""
    return [
        Split(name=str(name), reaches=reaches, digest=split_digest(rows), cases=tuple(cases_from_frame(rows)))
        for name, rows in table.assign(window=0.0).groupby("split", sort=False)
    ]


def _frame(split: Split) -> pd.DataFrame:
    experts = pd.DataFrame([(case.expert.gain, case.expert.critical) for case in split.cases])
    frame = setting.to_frame([case.setting for case in split.cases])
    return frame.assign(split=split.name, gain=experts[0], critical=experts[1])


def _entries(board: Path) -> tuple[dict[str, str], dict[str, str]]:
    """The hashes of all rows that will play, and the authors of submissions; raises BadInput."""
    playing = {name: rows for name, rows in rows_by_name(board).items() if can_play(rows[0])}
    authors = {}
    for name, rows in playing.items():
        manifest = rows[0].run.path.parent / bundle.MANIFEST
        if manifest.exists():
            declared = records.read(manifest, Manifest).declared.authors
            authors[name] = names.appearance(declared or rows[0].result.method)
    for reaches in get_args(RankedSource):
        of_author = Counter(author for name, author in authors.items() if name.endswith(f"/{reaches}"))
        for author, count in of_author.most_common(1):
            if count > ENTRIES:
                raise BadInput(f"{author!r} has {count} rows on {reaches} reaches; a round takes {ENTRIES}")
    return {name: entry_hash(rows) for name, rows in playing.items()}, authors


def _sha256(text: str) -> str:
    return hashing.digest(text.encode())
