"""Expert databases: kept rows, counts and checks, with numbers computed by hand."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dextron_bench.errors import BadInput
from dextron_bench.experts import database
from dextron_bench.experts.montecarlo import Search
from dextron_bench.storage import atomic
from tests.helpers.short_reaches import SOURCE

SEARCH = Search("brief", seed=7, experts=3, block=2)


@pytest.fixture
def draws() -> pd.DataFrame:
    """Six draws, two settings of three experts. Reach a takes 3.5 s without noise, b 0.8 s longer with noise 1."""
    return pd.DataFrame(
        {
            "reach": ["a", "a", "a", "b", "b", "b"],
            "offset_x": [0.01] * 3 + [-0.02] * 3,
            "offset_y": [0.0] * 6,
            "duration_noise": [0.0] * 3 + [1.0] * 3,
            "gain": [1.2] * 3 + [1.4] * 3,
            "critical": [0.05, 0.35, 0.85, 0.15, 0.39, 0.9],
            "score": [20.0, 1.0, 0.0, 19.0, 20.0, 0.0],
            "length": [100, 50, 60, 110, 120, 40],
        }
    )


@pytest.fixture
def saved(draws: pd.DataFrame, tmp_path: Path) -> Path:
    file, _ = database.save(draws, SOURCE, SEARCH, tmp_path, "experts-brief")
    return file


def test_only_draws_above_1_are_kept_and_are_loaded_bit_for_bit(draws: pd.DataFrame, saved: Path):
    expected = draws.iloc[[0, 3, 4]].reset_index(drop=True)
    pd.testing.assert_frame_equal(database.load(saved), expected, check_dtype=False, check_exact=True)


def test_the_summary_counts_all_draws(draws: pd.DataFrame, tmp_path: Path):
    file, about = database.save(draws, SOURCE, SEARCH, tmp_path, "experts-brief")
    assert file == tmp_path / "experts-brief.parquet"
    counts = {name: getattr(about, name) for name in ("draws", "settings", "kept", "solved")}
    assert counts == {"draws": 6, "settings": 2, "kept": 3, "solved": 2}
    assert asdict(about.search) == {"reaches": "brief", "seed": 7, "experts": 3, "block": 2}
    assert json.loads(file.with_suffix(".json").read_text()) == json.loads(atomic.json_text(about))
    assert database.summary(file).digest == database.rows_digest(database.load(file))


def test_statistics_by_hand(draws: pd.DataFrame):
    counted = {(row["by"], row["value"]): row for row in database.statistics(draws, SOURCE).to_dict("records")}

    def band(by: str) -> dict[str, tuple[int, ...]]:
        """Draws, kept and solved of each value."""
        names = ("draws", "kept", "solved")
        return {value: tuple(row[n] for n in names) for (group, value), row in counted.items() if group == by}

    assert (counted["all", "all"]["kept_rate"], counted["all", "all"]["solved_rate"]) == (0.5, 2 / 6)
    assert band("all") == {"all": (6, 3, 2)}
    assert band("subject") == {"made-up": (6, 3, 2)}
    assert band("ring") == {"0": (6, 3, 2)}
    assert band("angle") == {"3": (6, 3, 2)}
    assert band("region") == {"03": (6, 3, 2)}
    assert band("d_c") == {
        "0.0 to 0.1": (1, 1, 1),
        "0.1 to 0.2": (1, 1, 0),
        "0.3 to 0.4": (2, 1, 1),
        "0.8 to 0.9": (2, 0, 0),  # The last band includes both of its ends.
    }
    assert band("duration") == {"3.0 to 4.0": (3, 1, 1), "4.0 to 5.0": (3, 2, 1)}


def test_the_digest_depends_on_the_order_of_rows_and_on_every_bit(draws: pd.DataFrame):
    digest = database.rows_digest(draws)
    assert database.rows_digest(draws[draws.columns[::-1]]) == digest  # Columns are sorted by name.
    assert database.rows_digest(draws.iloc[::-1]) != digest
    other = draws.copy()
    other.loc[2, "critical"] = np.nextafter(0.85, 1.0)
    assert database.rows_digest(other) != digest


def complaint(file: Path) -> str:
    with pytest.raises(BadInput) as caught:
        database.load(file)
    assert str(file) in str(caught.value)
    assert "make it again" in str(caught.value)
    return str(caught.value)


def test_a_cut_file_is_damaged(saved: Path):
    saved.write_bytes(saved.read_bytes()[:-100])
    assert "is damaged" in complaint(saved)


def test_rows_that_do_not_match_the_summary_raise(saved: Path):
    database.load(saved).iloc[1:].to_parquet(saved)
    assert "summary" in complaint(saved)


@pytest.mark.parametrize("column", ["reach", "critical"])
def test_a_missing_column_raises(saved: Path, column: str):
    database.load(saved).drop(columns=column).to_parquet(saved)
    complaint(saved)


@pytest.mark.parametrize("text", ["{", "[]", "7", "{}", "null"])
def test_a_damaged_summary_raises(saved: Path, text: str):
    saved.with_suffix(".json").write_text(text)
    assert "summary" in complaint(saved)


def test_a_missing_file_is_not_damage(saved: Path):
    saved.unlink()
    with pytest.raises(FileNotFoundError):
        database.load(saved)


@pytest.mark.parametrize("reaches", ["real", "synthetic"])
def test_the_shipped_databases_can_be_loaded(reaches: str):
    try:
        rows, _ = database.load_shipped(reaches)
    except FileNotFoundError:
        pytest.skip(f"no database of {reaches} reaches ships")
    assert (rows["score"] > 1.0).all()
    assert rows["gain"].between(1.0, 1.5).all()
    assert rows["critical"].between(0.01, 0.9).all()


def test_a_search_extends_only_a_database_of_the_same_physics(monkeypatch: pytest.MonkeyPatch):
    summary = database.load_shipped("synthetic")[1]
    database.check_physics(summary)
    monkeypatch.setattr(database.model, "mjcf_hash", lambda: "f" * 64)
    with pytest.raises(BadInput, match="this version has ffffffff; search again without --extend"):
        database.check_physics(summary)
