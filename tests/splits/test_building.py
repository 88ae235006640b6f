"""Splits share no held-out reach, subject or setting, and a scan measures how hard each row is."""

import json

import numpy as np
import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import policies
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches import setting
from dextron_bench.reaches.minjerk import MinjerkSource
from dextron_bench.splits import building, building_minjerk
from dextron_bench.splits.building import Sizes, TooFewRows
from dextron_bench.splits.loading import cases_from_frame, split_digest
from dextron_bench.splits.near_equal import SETTING
from dextron_bench.world.engine import Engine

SIZES = Sizes(evaluated=20, val=10, open=5, reaches=0.25)
RATES = {name: 0.01 * k for k, name in enumerate("abcdefgh", start=1)}  # Success rate of a search by subject.


class Strata(setting.ReachSource):
    """A source of 32 reaches of 8 subjects; no reach is played."""

    def __init__(self) -> None:
        super().__init__("made-up", [])
        self.names = tuple(f"{subject}-{reach}" for subject in "abcdefgh" for reach in range(4))

    def stratum(self, reach: str) -> setting.Stratum:
        return setting.Stratum(reach[0], 0, 0)


@pytest.fixture(scope="module")
def database() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    settings = pd.DataFrame(
        {
            "reach": rng.choice(Strata().names, 400),
            "offset_x": rng.uniform(-0.06, 0.06, 400),
            "offset_y": rng.uniform(-0.06, 0.06, 400),
            "duration_noise": rng.standard_normal(400),
        }
    )
    rows = settings.loc[np.repeat(np.arange(400), 3)].reset_index(drop=True)
    rows["gain"], rows["critical"] = 1.2, np.tile([0.2, 0.4, 0.6], 400)
    rows["score"] = np.tile([20.0, 20.0, 12.0], 400)
    return rows


@pytest.fixture(scope="module")
def parts(database) -> dict[str, pd.DataFrame]:
    return building.partition(Strata(), database, 0, SIZES, RATES)


def subjects(rows: pd.DataFrame) -> set[str]:
    return set(rows["reach"].str[0])


def test_sizes_and_only_solved_rows(parts):
    assert {name: len(rows) for name, rows in parts.items() if name != "train"} == {
        "val": 10, "test": 20, "unseen-reach": 20, "unseen-subject": 20,
    }  # fmt: skip
    assert all((rows["score"] == 20).all() for rows in parts.values())


def test_no_split_shares_settings_reaches_or_subjects_that_it_must_not(parts):
    others = pd.concat([parts["train"], parts["val"], parts["test"], parts["unseen-reach"]])
    assert len(subjects(parts["unseen-subject"])) == 2
    assert not subjects(parts["unseen-subject"]) & subjects(others)
    seen = pd.concat([parts["train"], parts["val"], parts["test"]])
    assert not set(parts["unseen-reach"]["reach"]) & set(seen["reach"])
    settings = [set(rows[SETTING].itertuples(index=False, name=None)) for rows in parts.values()]
    assert sum(map(len, settings)) == len(set.union(*settings))


def test_one_unseen_subject_is_from_the_hardest_third_and_one_from_the_middle():
    """Of nine subjects, three are in each third; the easiest three are never held out."""
    rates = {"p": 0.5, "q": 0.1, "r": 0.9, "s": 0.3, "t": 0.8, "u": 0.2, "v": 0.7, "w": 0.4, "x": 0.6}
    drawn = [building.unseen_subjects(rates, np.random.default_rng(seed)) for seed in range(40)]
    assert {name for pair in drawn for name in pair} == {"q", "u", "s", "w", "p", "x"}
    assert all(len(pair & {"q", "u", "s"}) == 1 and len(pair & {"w", "p", "x"}) == 1 for pair in drawn)


def test_train_keeps_every_expert_of_a_setting_and_other_splits_keep_one(parts):
    assert (parts["train"].groupby(SETTING).size() == 2).all()
    assert (parts["test"].groupby(SETTING).size() == 1).all()


def test_equal_seeds_give_equal_splits(database, parts):
    again = building.partition(Strata(), database, 0, SIZES, RATES)
    for name, rows in parts.items():
        pd.testing.assert_frame_equal(rows, again[name])


def test_a_database_that_is_too_small_raises(database):
    with pytest.raises(TooFewRows, match="needs 20 solved settings"):
        building.partition(Strata(), database.head(60), 0, SIZES, None)


# `minjerk` has one expert and no offsets.

FEW = building_minjerk.Sizes(train=2, val=1, test=2, scan=2, batch=3)


@pytest.fixture(scope="module")
def minjerk() -> dict[str, pd.DataFrame]:
    return building_minjerk.draw(MinjerkSource(), Engine(8, 1), 0, FEW)


@pytest.mark.slow
def test_minjerk_trains_on_listed_reaches_and_evaluates_on_others(minjerk):
    assert {name: len(rows) for name, rows in minjerk.items()} == {"train": 2, "val": 1, "test": 2}
    reaches = [name for rows in minjerk.values() for name in rows["reach"]]
    assert len(set(reaches)) == 5
    listed = set(MinjerkSource().names)
    assert [name in listed for name in reaches] == [True] * 2 + [False] * 3


@pytest.mark.slow
def test_the_expert_of_minjerk_solves_all_rows_and_the_order_is_drawn(minjerk):
    source, rows = MinjerkSource(), pd.concat(minjerk.values())
    assert set(zip(rows["gain"], rows["critical"], strict=True)) == {(2.0, 0.15)}
    played = dict(rollout(ExpertAgent(), source, cases_from_frame(rows.assign(window=0.0)), threads=1))
    assert [episode.score for episode in played.values()] == [20.0] * 5
    drawn = np.random.default_rng([0, 0, 3]).permutation(1000)
    order = [f"minjerk-{number:06d}" for number in drawn]
    assert [order.index(name) for name in minjerk["train"]["reach"]] == sorted(
        map(order.index, minjerk["train"]["reach"])
    )


def test_unsolved_minjerk_reaches_are_skipped(monkeypatch):
    monkeypatch.setattr(building_minjerk, "EXPERT", policies.Expert(2.0, 0.9))  # Hits the bottle with a closed hand.
    with pytest.raises(TooFewRows, match="the splits need 1 solved minjerk reaches and there are 0"):
        building_minjerk.first_solved(MinjerkSource(), np.arange(4), 1, Engine(4, 1), batch=2)


@pytest.mark.slow
def test_writing_minjerk_keeps_the_other_sources(tmp_path):
    (tmp_path / "splits.json").write_text('{"real": {}}')
    entry = building_minjerk.build(tmp_path, Engine(8, 1), 0, FEW)
    assert json.loads((tmp_path / "splits.json").read_text()) == {"real": {}, "minjerk": entry}
    table = pd.read_parquet(tmp_path / "splits-minjerk.parquet")
    assert table.columns.tolist() == building.COLUMNS
    assert table["split"].tolist() == ["train"] * 2 + ["val"] + ["test"] * 2
    assert set(table["window"]) <= {0.0, 0.445, 0.89}
    assert entry["val"]["digest"] == split_digest(table[table["split"] == "val"])


def test_every_source_except_minjerk_needs_a_database(tmp_path, capsys):
    assert main.main(["data", "splits", "--reaches", "synthetic", "--into", str(tmp_path)]) == 2
    assert "splits of synthetic reaches need --database" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
