"""Baselines on a board play a split under tracks; their scores are kept, shown and verified."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.leaderboard import collect
from dextron_bench.splits.tracks import TRACKS

PLAYED = [name for name, track in TRACKS.items() if track.bottle is None]  # The tiny world has no other bottles.
RESULT = "results/reflex/synthetic/seed0/result.json"


@pytest.fixture
def board(tiny_world: Path) -> Path:
    """A board with two baselines on a tiny benchmark."""
    for method in ("nothing", "reflex"):
        assert main.main(["run", "--method", method, "--quiet"]) == 0
    assert main.main(["leaderboard", "build", "--runs", "runs", "--board", "board"]) == 0
    return tiny_world / "board"


def words(*more: str) -> list[str]:
    return ["leaderboard", "tracks", "--reaches", "synthetic", "--board", "board", "--quiet", *more]


@pytest.mark.slow
def test_rows_play_each_track_once_and_keep_it(board: Path, capsys: pytest.CaptureFixture[str]):
    before = collect.run_digest(board / RESULT)
    assert main.main(words("--method", "reflex", "--track", "delay-100")) == 0
    assert "reflex, synthetic reaches, seed 0: 1 of 1 tracks played now" in capsys.readouterr().out
    assert main.main(words()) == 0
    printed = capsys.readouterr().out
    assert f"reflex, synthetic reaches, seed 0: {len(PLAYED) - 1} of {len(PLAYED)} tracks played now" in printed
    assert f"nothing, synthetic reaches, seed 0: {len(PLAYED)} of {len(PLAYED)} tracks played now" in printed
    splits = json.loads((board / RESULT).read_text())["splits"]
    assert {f"test+{track}" for track in PLAYED} < splits.keys()
    assert {len(splits[f"test+{track}"]["scores"]) for track in PLAYED} == {len(splits["test"]["scores"])}
    assert "Return under tracks, test of synthetic reaches" in (board / "index.html").read_text()
    assert collect.run_digest(board / RESULT) == before  # The step of `rebuild` that made the row stays fresh.
    assert main.main(["leaderboard", "build", "--runs", "runs", "--board", "board"]) == 0
    assert json.loads((board / RESULT).read_text())["splits"] == splits  # The same run, published again, loses none.


@pytest.mark.slow
def test_scores_under_tracks_are_verified(board: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(words("--track", "delay-300")) == 0
    verification = ["leaderboard", "verify", "--all", "--board", "board", "--quiet"]
    assert main.main(verification) == 0
    result = json.loads((board / RESULT).read_text())
    result["splits"]["test+delay-300"]["scores"][0] = 7.0
    (board / RESULT).write_text(json.dumps(result))
    capsys.readouterr()
    assert main.main(verification) == 1
    assert "test+delay-300 row 0: says return 7" in capsys.readouterr().out


@pytest.mark.slow
def test_sources_without_rows_are_left_out(board: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(["leaderboard", "tracks", "--track", "delay-100", "--board", "board", "--quiet"]) == 0
    assert "reflex, synthetic reaches, seed 0: 1 of 1 tracks" in capsys.readouterr().out


def test_an_unknown_track_is_named(board: Path, capsys: pytest.CaptureFixture[str]):
    assert main.main(words("--track", "delay-7")) == 2
    assert "no track 'delay-7'; choose from delay-40" in capsys.readouterr().err
