"""Splits with other bottles: each row has a bottle that an expert of the search succeeds with."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.splits import bottles, loading, tracks
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.storage import atomic, records
from dextron_bench.world.bottles import model_bottle

MASS = tracks.BOTTLES["bottle-mass"]
PLAIN = pd.DataFrame(
    {
        "split": "test",
        "reach": [f"r{k % 3}" for k in range(40)],
        "offset_x": np.linspace(-0.05, 0.05, 40),
        "offset_y": 0.0,
        "duration_noise": 0.1,
        "gain": 5.0,
        "critical": 0.3,
        "window": 0.2,
    }
)


class LightOnly:
    """A scanner in whose world experts with one d_c lift bottles up to a mass [kg], and no other expert does."""

    source = SimpleNamespace(name="synthetic")

    def __init__(self, largest: float) -> None:
        self.largest, self.scanned = largest, []

    def scan(self, rows: pd.DataFrame, points: int) -> np.ndarray:
        self.scanned.append(rows)
        scores = np.zeros((len(rows), points))
        scores[:, points // 2] = np.where(rows["mass"] <= self.largest, 20.0, 3.0)
        return scores


def test_a_bottle_that_nobody_lifts_is_drawn_again():
    scanner: Any = LightOnly(0.5)
    rows = bottles.certified(scanner, PLAIN, MASS)
    assert list(rows[SETTING[0]]) == list(PLAIN[SETTING[0]])
    assert (rows["split"] == "test+bottle-mass").all()
    drawn = rows["mass"] != model_bottle().mass
    assert drawn.sum() > 30
    assert rows["mass"][drawn].between(0.25, 0.5).all()
    assert (rows["friction"] == 1.0).all()
    assert (rows["radius"] == 0.025).all()
    first = scanner.scanned[0]["mass"] <= 0.5
    assert (rows["gain"][first] == 5.0).all()
    assert (rows["gain"][drawn & ~first] != 5.0).all()
    sizes = [len(part) for part in scanner.scanned]
    assert sizes[0] == 40
    assert sizes == sorted(sizes, reverse=True)
    assert len(sizes) == bottles.TRIES
    assert rows["window"][first].iloc[0] == pytest.approx(0.89 / bottles.POINTS)


def test_a_row_that_nobody_solves_keeps_the_model_s_bottle_and_its_expert():
    scanner: Any = LightOnly(0.0)
    rows = bottles.certified(scanner, PLAIN, MASS)
    assert (rows["mass"] == model_bottle().mass).all()
    assert rows[["gain", "critical", "window"]].equals(PLAIN[["gain", "critical", "window"]])


@pytest.mark.parametrize("track", tracks.BOTTLES.values(), ids=tracks.BOTTLES)
def test_a_track_changes_one_quantity_within_its_range(track: tracks.Track):
    rows, again = (bottles.draw(PLAIN, track, 0) for _ in range(2))
    assert rows.equals(again)
    assert track.bottle
    values = rows[track.bottle.quantity]
    assert values.between(track.bottle.low, track.bottle.high).all()
    assert values.nunique() == 40
    others = {"mass", "friction", "radius"} - {track.bottle.quantity}
    assert all(rows[name].unique() == [getattr(model_bottle(), name)] for name in others)


def test_the_tables_are_read_as_splits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    known = {"synthetic": {"test": loading.SplitEntry(40, "d")}, "real": {}}
    atomic.write_json(tmp_path / "splits.json", known)
    scanner: Any = LightOnly(1.0)
    entries = bottles.build(scanner, PLAIN, tmp_path)
    catalogue = records.read(tmp_path / "splits.json", loading.Catalogue)
    assert catalogue == {"synthetic": known["synthetic"] | entries, "real": {}}
    monkeypatch.setattr(loading, "_catalogue", lambda: catalogue)
    monkeypatch.setattr(loading, "_table", lambda _, name: pd.read_parquet(tmp_path / name))
    split = loading.load_split("synthetic", "test+bottle-radius")
    assert len(split.bottles) == len(split.cases) == 40
    assert split.track.name == "bottle-radius"
    assert split.rows([3]).bottles == (split.bottles[3],)
    assert split.bottles[3].mass == model_bottle().mass
    assert {name: len(loading.load_split("synthetic", name).digest) for name in entries} == dict.fromkeys(entries, 64)
    with pytest.raises(loading.UnknownSplit, match=r"choose from test\+bottle-friction"):
        loading.load_split("synthetic", "hard+bottle-mass")
    changed = pd.read_parquet(tmp_path / "bottles-synthetic.parquet").assign(mass=0.3)
    monkeypatch.setattr(loading, "_table", lambda *_: changed)
    with pytest.raises(BadInput):
        loading.load_split("synthetic", "test+bottle-mass")
