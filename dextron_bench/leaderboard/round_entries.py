"""The entries of a round: the rows of a board that can be run again, and the hashes of what plays as them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

from dextron_bench.errors import BadInput
from dextron_bench.leaderboard import board_rows
from dextron_bench.leaderboard.board_rows import Row
from dextron_bench.methods import registry
from dextron_bench.reaches.sources import RankedSource
from dextron_bench.storage import atomic, hashing, records
from dextron_bench.submissions import bundle, names
from dextron_bench.submissions.manifest import Manifest

MOST = 3  # Rows of one author in a round.


def of_board(board: Path) -> tuple[dict[str, str], dict[str, str]]:
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
            if count > MOST:
                raise BadInput(f"{author!r} has {count} rows on {reaches} reaches; a round takes {MOST}")
    return {name: entry_hash(rows) for name, rows in playing.items()}, authors


def announced(board: Path, number: int, entries: Mapping[str, str]) -> list[Row]:
    """The rows of the board that play a round, whose `entries` were announced.

    Raises BadInput if one of them was changed since, NotFound, DamagedFile.
    """
    by_name = rows_by_name(board)
    for name, sha256 in entries.items():
        if name not in by_name or entry_hash(by_name[name]) != sha256:
            raise BadInput(f"{name} is not what round {number} has announced; it cannot play in it")
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
