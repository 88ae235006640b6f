"""Splits: frozen, content-hashed lists of settings; each row has an expert and its window of success."""

from __future__ import annotations

import errno
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches import setting
from dextron_bench.splits import tracks
from dextron_bench.splits.rows import Rows, UnknownRow
from dextron_bench.splits.tracks import PLAIN, Track
from dextron_bench.storage import hashing
from dextron_bench.world import bottle

NUMBERS = ("offset_x", "offset_y", "duration_noise", "gain", "critical", "window")
SPLIT_NAMES = ("train", "val", "test", "unseen-reach", "unseen-subject", "hard", "open")
EVALUATED = ("test", "unseen-reach", "unseen-subject", "hard")


class UnknownSplit(KeyError):
    """A source of reaches has no split of that name."""

    def __init__(self, name: str, reaches: str, names: Sequence[str]) -> None:
        choice = f"choose from {', '.join(names)}" if names else "none ships; see `dextron-bench data splits`"
        super().__init__(f"no split {name!r} of {reaches!r} reaches; {choice}")

    def __str__(self) -> str:
        return str(self.args[0])


class DamagedSplit(ValueError):
    """A split cannot be read, or its content differs from its hash."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Split(Rows):
    """A named list of cases of a source of reaches; `digest`, the SHA-256 of its content, is its version."""

    name: str
    reaches: str
    digest: str

    def case(self, row: int) -> Case:
        """The case of a row; raises UnknownRow."""
        if not 0 <= row < len(self):
            raise UnknownRow(f"{self.name} of {self.reaches} reaches has rows 0 to {len(self) - 1}, not {row}")
        return self.cases[row]


def known_splits(reaches: str) -> tuple[str, ...]:
    """Names of the splits that ship for a source of reaches."""
    return tuple(name for name in SPLIT_NAMES if name in _catalogue().get(reaches, {}))


def ranking_splits(reaches: str) -> tuple[str, ...]:
    """Names of the shipped splits that rank methods; raises UnknownSplit if the source has none."""
    names = tuple(name for name in known_splits(reaches) if name in EVALUATED)
    if not names:
        raise UnknownSplit(EVALUATED[0], reaches, known_splits(reaches))
    return names


def all_splits() -> list[tuple[str, str]]:
    """Source of reaches and name of every shipped split."""
    return [(reaches, name) for reaches in _catalogue() for name in known_splits(reaches)]


def load_split(reaches: str, name: str) -> Split:
    """The shipped split of a name, verified against its hash, perhaps under a track, as in `test+delay-100`.

    Raises UnknownSplit, UnknownTrack, DamagedSplit.
    """
    if not isinstance(reaches, str) or not isinstance(name, str):
        raise UnknownSplit(name, reaches, known_splits(reaches) if isinstance(reaches, str) else ())
    whole_name, (name, track) = name, tracks.parse(name)
    if track.bottle is not None:
        return _load_with_bottles(reaches, whole_name, track)
    if name not in known_splits(reaches):
        raise UnknownSplit(name, reaches, known_splits(reaches))
    rows, digest = _rows(_table(reaches, f"splits-{reaches}.parquet"), reaches, name)
    if track != PLAIN:
        digest = hashing.digest(f"{digest} {track}".encode())
    cases = tuple(cases_from_frame(rows))
    return Split(name=whole_name, reaches=reaches, digest=digest, cases=cases, track=track)


def splits_under(reaches: str, names: Sequence[str], track: str) -> list[str]:
    """Names of some splits under a track; only `test` has other bottles. Raises UnknownTrack, UnknownSplit."""
    under = [tracks.name_of(name, track) for name in names]
    if tracks.TRACKS[track].bottle is None:
        return under
    known = _splits_with_bottles(reaches)
    if not set(under) & set(known):
        raise UnknownSplit(under[0], reaches, known)
    return [name for name in under if name in known]


def bottles_file(reaches: str) -> str:
    """The name of the table of a source's splits with other bottles."""
    return f"bottles-{reaches}.parquet"


def _load_with_bottles(reaches: str, name: str, track: Track) -> Split:
    if name not in (known := _splits_with_bottles(reaches)):
        raise UnknownSplit(name, reaches, known)
    rows, digest = _rows(_table(reaches, bottles_file(reaches)), reaches, name)
    cases, bottles = tuple(cases_from_frame(rows)), tuple(bottle.from_frame(rows))
    return Split(name=name, reaches=reaches, digest=digest, cases=cases, track=track, bottles=bottles)


def _splits_with_bottles(reaches: str) -> list[str]:
    return [name for name in _catalogue().get(reaches, {}) if tracks.PLUS in name]


def _rows(table: pd.DataFrame, reaches: str, name: str) -> tuple[pd.DataFrame, str]:
    """The rows of a split, and their hash; raises DamagedSplit if it is not the hash of the catalogue."""
    try:
        rows = table[table["split"] == name]
        digest, expected = split_digest(rows), _catalogue()[reaches][name]["digest"]
    except (KeyError, ValueError, TypeError) as error:
        raise DamagedSplit(f"the splits of {reaches!r} reaches lack {error}; reinstall the package") from error
    if digest != expected:
        raise DamagedSplit(
            f"split {name!r} of {reaches!r} reaches is damaged (hash {digest[:12]}); reinstall the package"
        )
    return rows, digest


def cases_from_frame(rows: pd.DataFrame) -> list[Case]:
    """The cases of a table with the columns of a setting, `gain`, `critical` and `window`."""
    experts = zip(rows["gain"], rows["critical"], rows["window"], strict=True)
    return [
        Case(one, Expert(float(gain), float(critical)), float(window))
        for one, (gain, critical, window) in zip(setting.from_frame(rows), experts, strict=True)
    ]


def split_digest(rows: pd.DataFrame) -> str:
    """SHA-256 of a split's rows in order: names of reaches as UTF-8, numbers as little-endian float64.

    The numbers are NUMBERS, and the columns of the bottles if the rows have them.
    """
    names = "\n".join(rows["reach"]).encode()
    numbers = [*NUMBERS, *(name for name in bottle.COLUMNS if name in rows)]
    return hashing.digest(names, *(np.ascontiguousarray(rows[c], "<f8").tobytes() for c in numbers))


@cache
def _catalogue() -> dict[str, dict[str, Any]]:
    try:
        return json.loads(files("dextron_bench.data").joinpath("splits.json").read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError) as error:
        raise DamagedSplit(f"the catalogue of splits cannot be read ({error}); reinstall the package") from error


@cache
def _table(reaches: str, name: str) -> pd.DataFrame:
    with as_file(files("dextron_bench.data").joinpath(name)) as file:
        try:
            return pd.read_parquet(file)
        except (OSError, ValueError) as error:
            if isinstance(error, OSError) and error.errno not in (None, errno.ENOENT):  # Permission, for example.
                raise
            raise DamagedSplit(f"the splits of {reaches!r} reaches cannot be read; reinstall the package") from error
