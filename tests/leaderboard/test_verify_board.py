"""The command line submits, verifies and adds submissions, and verifies the whole leaderboard."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from dextron_bench import recording
from dextron_bench.cli import main
from dextron_bench.methods.isolation import sandbox
from dextron_bench.storage import folders


@pytest.mark.slow
def test_the_command_line_submits_verifies_adds_and_verifies_the_board(
    submitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    words = [
        "submit",
        f"{submitted}/near.py:Near",
        "--name",
        "mine",
        "--seed",
        "0",
        "--near",
        "0.05",
        "--quiet",
    ]
    assert main.main(words) == 0
    assert "mine-synthetic.zip" in capsys.readouterr().out
    assert main.main(["leaderboard", "verify", "mine-synthetic.zip", "--rerun", "--trust"]) == 0
    tier = "re-run" if sandbox.is_available() else "replayed"
    assert f"{tier}; 4 of 4 episodes equal bit for bit" in capsys.readouterr().out
    assert main.main(["leaderboard", "add", "mine-synthetic.zip", "--board", "board"]) == 0
    assert "| `mine` |" in (tmp_path / "board" / "README.md").read_text()
    assert main.main(["leaderboard", "add", "mine-synthetic.zip", "--board", "board"]) == 2
    assert "--replace replaces it" in capsys.readouterr().err
    assert main.main(["leaderboard", "add", "mine-synthetic.zip", "--board", "board", "--replace"]) == 0
    assert main.main(["leaderboard", "verify", "--all", "--board", "board"]) == 0
    assert "mine, synthetic reaches, seed 0: replayed, 4 of 4 episodes" in capsys.readouterr().out
    words = ["submit", f"{submitted}/near.py:Near", "--name", "other", "--seed", "0", "--board", "board", "--quiet"]
    assert main.main(words) == 0
    printed = capsys.readouterr().out
    assert printed.count("│ mine ") == printed.count("│ other ") == 2  # On `test` and `unseen-reach`.
    file = tmp_path / "board/results/mine/synthetic/seed0/result.json"
    file.write_text(file.read_text().replace("20.0", "0.0", 1))
    assert main.main(["leaderboard", "verify", "--all", "--board", "board"]) == 1
    printed = capsys.readouterr().out
    assert "DIFFERS from its episodes" in printed
    assert "table.csv differs" in printed


@pytest.mark.slow
def test_missing_and_additional_seeds_on_the_board_are_problems(
    submitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    board = tmp_path / "board"
    assert main.main(["leaderboard", "add", str(submitted / "twins.zip"), "--board", str(board)]) == 0
    folder = board / "results/near/synthetic"
    shutil.copytree(folder / "seed0", folder / "seed2")
    assert main.main(["leaderboard", "verify", "--all", "--board", str(board)]) == 1
    printed = capsys.readouterr().out
    assert "lies in near/synthetic/seed2, but is of near, synthetic reaches, seed 0" in printed
    assert "has seed0, seed1, seed2, but its manifest has seed0, seed1" in printed
    shutil.rmtree(folder / "seed2")
    shutil.rmtree(folder / "seed1")
    assert main.main(["leaderboard", "verify", "--all", "--board", str(board)]) == 1
    assert "has seed0, but its manifest has seed0, seed1" in capsys.readouterr().out


@pytest.mark.slow
def test_an_interrupted_addition_can_be_repeated(submitted: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    board, words = tmp_path / "board", ["leaderboard", "add", str(submitted / "near.zip"), "--board"]
    assert main.main([*words, str(board)]) == 0
    before = {file: file.read_bytes() for file in board.rglob("*") if file.is_file()}
    with monkeypatch.context() as patch:
        patch.setattr(folders, "_put", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        assert main.main([*words, str(board), "--replace"]) == 130
    assert {file: file.read_bytes() for file in board.rglob("*") if file.is_file()} == before
    assert main.main([*words, str(board), "--replace"]) == 0
    assert sorted(place.name for place in (board / "results/near").iterdir()) == ["synthetic"]
    assert not (tmp_path / ".board.part").exists()


@pytest.mark.slow
def test_view_records_any_episode_of_a_bundle(
    submitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """The bundle has recordings of row 0 only; row 2 of `test` failed."""
    monkeypatch.chdir(tmp_path)
    bundle = str(submitted / "twins.zip")
    assert main.main(["view", bundle, "--print"]) == 0
    assert {Path(line).name for line in capsys.readouterr().out.split()} == {"test-0000.rrd", "unseen-reach-0000.rrd"}
    assert main.main(["view", bundle, "--print", "--failed", "--seed", "1", "--quiet"]) == 0
    [file] = capsys.readouterr().out.split()
    assert file.endswith("seed1/recordings/test-0002.rrd")
    recorded = recording.read(Path(file))
    assert (recorded.properties["method"], recorded.episode.score) == ("near", 0.0)
    assert main.main(["view", bundle, "--print", "--failed", "--seed", "1", "--quiet"]) == 0
    assert capsys.readouterr().out.split() == [file]
    cut = tmp_path / "cut.zip"
    cut.write_bytes(Path(bundle).read_bytes()[:-30])
    for place, problem in ((cut, "is not a complete zip file"), (tmp_path / "none.zip", "none.zip is not a file")):
        assert main.main(["view", str(place), "--print"]) == 2
        assert problem in capsys.readouterr().err
    assert sorted(path.name for path in (tmp_path / "runs/submissions/.bundles").iterdir()) == [Path(file).parts[3]]


@pytest.mark.slow
def test_baselines_on_a_board_are_run_again(submitted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Actions of `random` depend on which rows are played together, so the verifier plays all its rows."""
    runs, board = str(tmp_path / "runs"), tmp_path / "board"
    for method in ("exp", "random"):
        assert main.main(["run", "--method", method, "--record", "0", "--runs", runs, "--quiet"]) == 0
    assert main.main(["leaderboard", "build", "--runs", runs, "--board", str(board)]) == 0
    capsys.readouterr()
    assert main.main(["leaderboard", "verify", "--all", "--rows", "1", "--board", str(board)]) == 0
    printed = capsys.readouterr().out
    assert "exp, synthetic reaches, seed 0: run again, 2 of 4 episodes, all equal" in printed
    assert "random, synthetic reaches, seed 0: run again" in printed
    copied = board / "results/best/synthetic/seed0"
    shutil.copytree(board / "results/exp/synthetic/seed0", copied)
    assert main.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "exp"]) == 1
    assert "lies in best/synthetic/seed0, but was made by exp" in capsys.readouterr().out
    shutil.rmtree(copied.parents[1])
    file = board / "results/exp/synthetic/seed0/result.json"
    text = file.read_text()
    result = json.loads(text)
    result["splits"]["test"]["causes"] = {"slipped": 3}
    file.write_text(json.dumps(result))
    assert main.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "exp"]) == 1
    assert "test says causes {'slipped': 3}; run again it is {'solved': " in capsys.readouterr().out
    result["splits"]["test"]["scores"] += [20.0]
    file.write_text(json.dumps(result))
    assert main.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "exp"]) == 2
    assert "test must have one score and one hash of actions for each row" in capsys.readouterr().out
    file.write_text(text.replace("20.0", "19.0", 1))
    assert main.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "exp"]) == 1
    assert "says return 19; run again it is 20" in capsys.readouterr().out
    assert main.main(["leaderboard", "verify", "--all", "--board", str(board), "--method", "none"]) == 2
    assert "its methods: exp, random" in capsys.readouterr().err


@pytest.mark.slow
def test_an_invalid_submission_is_refused_with_the_reason(submitted: Path, capsys: pytest.CaptureFixture[str]):
    for words, reason in (
        (["--name", "a/b"], "'a/b' is not a valid name"),
        (["--name", "a", "--memory", "0"], "--timeout and --memory are more than 0"),
        (["--name", "a", "--seed", "3"], "seeds must be 0, 1, 2 and so on"),
    ):
        assert main.main(["submit", f"{submitted}/near.py:Near", *words]) == 2
        assert reason in capsys.readouterr().err
    assert main.main(["leaderboard", "verify"]) == 2
    assert "give a submission, or --all" in capsys.readouterr().err


def test_a_submission_and_all_rows_are_not_verified_at_once(capsys: pytest.CaptureFixture[str]):
    assert main.main(["leaderboard", "verify", "mine.zip", "--all"]) == 2
    assert "leave out mine.zip, or leave out --all" in capsys.readouterr().err
