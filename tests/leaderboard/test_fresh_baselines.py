"""Baselines on a board play the same fresh settings, which are stored, and verification plays them again."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.splits import fresh
from dextron_bench.splits.loading import Split, cases_from_frame, split_digest
from tests.helpers import tiny_benchmark

METHODS = ("nothing", "reflex")


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Instead of a search: each fresh split has two solved settings; the list gets the names of the drawn splits."""
    names: list[str] = []
    rows = pd.DataFrame([("-", *one) for one in tiny_benchmark.SOLVED], columns=tiny_benchmark.COLUMNS)

    def draw(reaches: str, name: str, seed: int, *_: object) -> Split:
        names.append(name)
        table = rows.assign(window=0.0, duration_noise=rows["duration_noise"] + seed % 7 / 1000)
        return Split(name=name, reaches=reaches, digest=split_digest(table), cases=tuple(cases_from_frame(table)))

    monkeypatch.setattr(fresh, "draw", draw)
    return names


@pytest.fixture
def board(tiny_world: Path) -> Path:
    """A board with two baselines on a tiny benchmark."""
    for method in METHODS:
        assert main.main(["run", "--method", method, "--quiet"]) == 0
    assert main.main(["leaderboard", "build", "--runs", "runs", "--board", "board"]) == 0
    return tiny_world / "board"


def words(*more: str) -> list[str]:
    return ["leaderboard", "fresh", "--reaches", "synthetic", "--board", "board", "--quiet", *more]


def verification(*more: str) -> list[str]:
    return ["leaderboard", "verify", "--all", "--board", "board", "--quiet", *more]


@pytest.mark.slow
def test_all_baselines_play_one_draw_and_it_is_kept(board: Path, drawn: list[str], capsys: pytest.CaptureFixture[str]):
    assert main.main(words("--beacon", "a", "--method", "nothing")) == 0
    assert main.main(words()) == 0  # The other method, on the settings of the board.
    assert drawn == ["test", "unseen-reach"]
    results = [json.loads((board / f"results/{m}/synthetic/seed0/result.json").read_text()) for m in METHODS]
    assert {result["fresh"]["beacon"] for result in results} == {"a"}
    assert len({json.dumps(r["fresh"]["splits"]["test"]["digest"]) for r in results}) == 1
    table = pd.read_csv(board / "table.csv")
    assert table["fresh"].notna().all()
    assert "; fresh " in (board / "README.md").read_text()
    assert main.main(words("--beacon", "b")) == 0
    assert drawn == ["test", "unseen-reach"] * 2
    about = board / "fresh" / "synthetic.json"
    about.write_text(json.dumps(json.loads(about.read_text()) | {"submission": "0" * 64}))
    assert main.main(words()) == 0  # The stored settings are of another physics.
    assert drawn == ["test", "unseen-reach"] * 3


@pytest.mark.slow
def test_fresh_scores_of_baselines_are_verified(board: Path, drawn: list[str], capsys: pytest.CaptureFixture[str]):
    assert main.main(words("--beacon", "a")) == 0
    assert main.main(verification("--redraw")) == 0
    file = board / "results/reflex/synthetic/seed0/result.json"
    right = json.loads(file.read_text())
    wrong = json.loads(file.read_text())
    wrong["fresh"]["splits"]["test"]["scores"] = [7.0, 7.0]
    file.write_text(json.dumps(wrong))
    capsys.readouterr()
    assert main.main(verification("--method", "reflex")) == 1
    assert "its scores on fresh settings of test differ from its episodes, run again" in capsys.readouterr().out
    file.write_text(json.dumps(right))
    (board / "fresh" / "synthetic.json").unlink()
    assert main.main(verification("--method", "reflex")) == 1
    assert "its fresh settings are missing" in capsys.readouterr().out
