"""Numbers in documents come from the leaderboard, the searches and the splits."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.experts import database, montecarlo
from dextron_bench.storage import atomic
from dextron_bench.world import model
from tools import documents

SCORES = [20.0, 20.0, 0.0, 7.0]
ENDINGS = dict.fromkeys(CAUSES, 0) | {"solved": 2, "too early": 1, "slipped": 1}


@pytest.fixture
def board(tmp_path: Path) -> Path:
    """A leaderboard with a method of one seed: four episodes, a mean return of 11.75, half of them solved."""
    add_seed(tmp_path, 0, SCORES, ENDINGS)
    return tmp_path


def add_seed(board: Path, seed: int, scores: list[float], endings: dict[str, int]) -> None:
    split = {"digest": "0" * 64, "scores": scores, "failed": 0, "causes": endings, "closing_lag": None}
    result = {"method": "mine", "reaches": "real", "seed": seed, "splits": {"test": split}, "provenance": {}}
    atomic.write_json(board / f"results/mine/real/seed{seed}/result.json", result)


def filled(board: Path, text: str) -> str:
    file = board / "page.md"
    file.write_text(text)
    documents.fill([file], board)
    return file.read_text()


def number(key: str) -> str:
    return f"<!--={key}-->?<!--.-->"


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("mine real test return", "11.8"),
        ("mine real test success", "50.0"),
        ("mine real test too-early", "25.0"),
        ("physics", model.mjcf_hash()[:8]),
    ],
)
def test_a_number_is_replaced_by_its_present_value(board: Path, key: str, expected: str):
    assert filled(board, f"before {number(key)} after") == f"before <!--={key}-->{expected}<!--.--> after"


def test_the_success_rates_of_the_seeds(board: Path):
    add_seed(board, 2, [0.0, 0.0, 0.0, 0.0], {"slipped": 4})
    add_seed(board, 1, [20.0, 20.0, 20.0, 3.0], {"solved": 3, "too late": 1})
    assert ">50.0, 75.0, 0.0<" in filled(board, number("mine real test seeds"))


def test_a_table_of_the_results_on_a_source(board: Path):
    shown = filled(board, number("results real"))
    assert "| method | seeds | `test` |" in shown
    assert "| `mine` | 1 | 11.8, 50.0 % |" in shown


def test_numbers_of_the_search(board: Path, monkeypatch: pytest.MonkeyPatch):
    """30 of 1,200 draws are 2.50 %; by d_c, half of 40 draws are solved."""
    rows = [
        database.Group("d_c", "0.0 to 0.1", 40, 20, 20, 0.5, 0.5),
        database.Group("region", "13", 100, 4, 4, 0.04, 0.04),
    ]
    summary = database.Summary(montecarlo.Search(), "", 1200, 150, 30, 12, rows)
    monkeypatch.setattr(database, "load_shipped", lambda reaches: (None, summary))
    assert filled(board, number("search real draws")) == "<!--=search real draws-->1,200<!--.-->"
    assert filled(board, number("search real kept_rate")) == "<!--=search real kept_rate-->2.50<!--.-->"
    assert "| `synthetic` | 1,200 | 150 | 30 | 12 | 2.50 | 1.00 |" in filled(board, number("search totals"))
    assert "| d_c | 0.0 to 0.1 |" in filled(board, number("search d_c"))
    assert "| ring 1 |  /  |  /  |  /  | 4.00 / 4.00 |" in filled(board, number("search regions"))


def test_filling_again_changes_nothing(board: Path):
    file = board / "page.md"
    file.write_text(number("mine real test return"))
    assert documents.fill([file], board) == [file]
    assert documents.fill([file], board) == []


@pytest.mark.parametrize(
    "key",
    [
        "nonsense",
        "results synthetic",
        "other real test return",
        "other real test seeds",
        "mine real test speed",
        "search real speed",
    ],
)
def test_a_key_that_names_nothing_is_refused_and_the_file_stays(board: Path, key: str):
    with pytest.raises(documents.UnknownNumber, match="names no number"):
        filled(board, number(key))
    assert (board / "page.md").read_text() == number(key)
