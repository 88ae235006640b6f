"""Shares of commands: the same bytes for any number of shares, and one line for what a merge lacks or refuses."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from dextron_bench.cli import main
from dextron_bench.runs import evaluation_job, execution
from dextron_bench.storage import provenance
from dextron_bench.storage.provenance import Machine, Provenance
from tests.helpers import tiny_training
from tests.helpers.tiny_runs import constant_agent, forbidden
from tests.helpers.tiny_training import TOY

RUN = ("run", "--method", "exp", "--quiet", "--threads", "1")
PIECES = "exp/synthetic/seed0/pieces"


@pytest.fixture
def here(tiny_world: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder with the tiny benchmark, cut into pieces of one row."""
    monkeypatch.setattr(evaluation_job, "ROWS", 1)
    on_machine("here", monkeypatch)
    return tiny_world


def on_machine(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pretends that this process runs on the machine of that name."""
    machine = Machine(system="Linux-6", cpu=name, cores=2)
    about = Provenance(git="abc", versions={"mujoco": "3"}, machine=machine)
    monkeypatch.setattr(provenance, "collect", lambda physics: replace(about, physics=physics))


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder except times, recordings and their hashes: row ids of recordings are random."""
    files = (file for file in folder.rglob("*") if file.is_file() and file.suffix != ".rrd")
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in files
        if file.name not in ("recordings.json", "times.json")
    }


def put_together(parts: list[Path], into: Path) -> None:
    for part in parts:
        shutil.copytree(part, into, dirs_exist_ok=True)


def play(words: tuple[str, ...], *more: str | Path) -> None:
    assert main.main([*words, *map(str, more)]) == 0


def play_shares(words: tuple[str, ...], of: int, into: Path) -> None:
    """Plays all shares, the last one first, in a folder for each, and puts the folders together."""
    parts = [into.with_name(f"{into.name}-{index}") for index in range(of)]
    for index in reversed(range(of)):
        play(words, "--share", f"{index}/{of}", "--runs", parts[index])
    put_together(parts, into)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "pieces"), [("exp", 3), ("nothing", 3), ("random", 2)])
def test_the_bytes_are_the_same_for_any_number_of_shares(
    here: Path, capsys: pytest.CaptureFixture[str], method: str, pieces: int
):
    """EXP and `nothing` are cut into rows; `random` draws for all rows of a split together, so it is not."""
    words = tuple(method if word == "exp" else word for word in RUN)
    play(words, "--runs", here / "whole")
    unshared, files = capsys.readouterr().out, contents(here / "whole")
    assert f"{method}/synthetic/seed0/episodes.parquet" in files
    for of in (1, 2, 3):
        merged = here / f"of{of}"
        play_shares(words, of, merged)
        assert f"of {pieces} pieces are done, in" in capsys.readouterr().out
        play(words, "--merge", "--runs", merged)
        assert capsys.readouterr().out == unshared.replace("whole", merged.name)
        assert contents(merged) == files
        recordings = sorted(path.name for path in (merged / method / "synthetic/seed0/recordings").iterdir())
        assert recordings == ["test-0000.rrd", "unseen-reach-0000.rrd"]
        assert sorted(json.loads((merged / method / "synthetic/seed0/recordings.json").read_text())) == recordings


@pytest.mark.slow
def test_a_merge_plays_nothing_and_may_be_repeated(here: Path, monkeypatch: pytest.MonkeyPatch):
    play_shares(RUN, 2, here / "runs")
    monkeypatch.setattr(execution, "rollout", forbidden)
    play(RUN, "--merge")
    files = contents(here / "runs")
    play(RUN, "--merge")
    play(RUN)
    assert contents(here / "runs") == files


@pytest.mark.slow
def test_the_command_without_a_share_plays_only_what_is_missing(here: Path, monkeypatch: pytest.MonkeyPatch):
    words = RUN
    play(words, "--runs", here / "whole")
    play(words, "--share", "1/2")
    played, rollout = [], execution.rollout
    monkeypatch.setattr(
        execution, "rollout", lambda *args, **more: played.append(len(args[2])) or rollout(*args, **more)
    )
    play(words)
    assert played == [1, 1]  # Of three pieces, share 1/2 has the second.
    assert contents(here / "runs") == contents(here / "whole")


@pytest.mark.slow
def test_pieces_of_two_machines_give_the_same_scores_and_name_both(here: Path, monkeypatch: pytest.MonkeyPatch):
    words = (*RUN, "--record", "0")
    play(words, "--runs", here / "whole")
    for index, machine in enumerate(("small", "large")):
        on_machine(machine, monkeypatch)
        play(words, "--share", f"{index}/2", "--runs", here / machine)
    folder = "exp/synthetic/seed0"
    merged = []
    for order in (["small", "large"], ["large", "small"]):
        on_machine("of the merge", monkeypatch)
        runs = here / "-".join(order)
        put_together([here / name for name in order], runs)
        play(words, "--merge", "--runs", runs)
        merged.append(contents(runs))
    assert merged[0] == merged[1]
    result, whole = (json.loads((runs / folder / "result.json").read_text()) for runs in (runs, here / "whole"))
    makers = result.pop("provenance")
    assert [maker["machine"]["cpu"] for maker in (makers, *makers["others"])] == ["large", "small"]
    assert result == {name: value for name, value in whole.items() if name != "provenance"}
    assert (runs / folder / "episodes.parquet").read_bytes() == (
        here / "whole" / folder / "episodes.parquet"
    ).read_bytes()


@pytest.mark.slow
def test_a_merge_of_nothing_or_of_some_pieces_names_what_is_missing(here: Path, complaint: Callable[..., str]):
    text = complaint(*RUN, "--merge")
    assert "the merge lacks 3 of 3 pieces: exp/synthetic/seed0/test-0000-0000, exp/synthetic/seed0/test-0001" in text
    play(RUN, "--share", "0/2")
    text = complaint(*RUN, "--merge")
    assert "lacks 1 of 3 pieces: exp/synthetic/seed0/test-0001-0001; run the shares that have them" in text
    assert not (here / "runs/exp/synthetic/seed0/episodes.parquet").exists()


def edited(file: Path, **entries: Any) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | entries))


@pytest.mark.slow
def test_doubled_foreign_and_damaged_pieces_are_named(here: Path, complaint: Callable[..., str]):
    words = (*RUN, "--record", "0")
    for command in (("--merge",), (), ("--share", "0/2")):
        shutil.rmtree(here / "runs", ignore_errors=True)
        play(words, "--share", "0/1")
        stamp = here / "runs" / PIECES / "test-0000-0000.json"
        whole, copy = stamp.read_text(), stamp.with_name("test-0000-0000 (copy).json")
        shutil.copy(stamp, copy)
        assert "are the same piece, test-0000-0000; remove one of them" in complaint(*words, *command)
        copy.unlink()
        edited(stamp, code="0" * 64)
        assert "is a piece of other work: it differs in the benchmark's code; use the same command" in complaint(
            *words, *command
        )
        edited(stamp, **json.loads(whole))
        edited(stamp, **{"depends on": json.loads(whole)["depends on"] | {"physics": "old", "split": "other"}})
        assert "it differs in physics and split;" in complaint(*words, *command)
        stamp.write_text(whole)
        table = stamp.with_suffix(".parquet")
        table.write_bytes(table.read_bytes()[:-9])
        assert "test-0000-0000.parquet is not what the piece was made with" in complaint(*words, *command)
        table.unlink()
        assert "test-0000-0000.parquet is missing" in complaint(*words, *command)
        stamp.write_text(whole[:40])
        assert f"{PIECES}/test-0000-0000.json is damaged" in complaint(*words, *command)


@pytest.mark.slow
def test_a_share_that_was_killed_leaves_no_half_piece(here: Path, monkeypatch: pytest.MonkeyPatch):
    words = (*RUN, "--record", "0")
    play(words, "--runs", here / "whole")

    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(evaluation_job.EvaluationJob, "complete", killed)
        assert main.main([*words, "--share", "0/1"]) == 130
    assert [path.name for path in (here / "runs" / PIECES).iterdir()] == ["test-0000-0000.parquet"]
    play(words, "--share", "0/1")
    play(words, "--merge")
    assert contents(here / "runs") == contents(here / "whole")


def test_pieces_of_an_agent_that_was_edited_do_not_fit(here: Path, complaint: Callable[..., str]):
    """The label of the edited agent is another one, so its merge finds no pieces at all."""
    words = ("run", "--method", constant_agent(here, "0.1"), "--quiet", "--record", "0")
    play(words, "--share", "0/1")
    assert sorted(file.stem for file in here.glob("runs/constant/*/*/pieces/*.json")) == [
        "test-0000-0001",
        "unseen-reach-0000-0000",
    ]
    play(words, "--merge")


@pytest.mark.parametrize("text", ["2/2", "-1/2", "half", "1"])
def test_shares_that_do_not_exist_are_refused(here: Path, complaint: Callable[..., str], text: str):
    assert "share" in complaint(*RUN, f"--share={text}")


def test_a_share_and_a_merge_at_once_are_refused(here: Path, complaint: Callable[..., str]):
    assert "give one of both" in complaint(*RUN, "--share", "0/2", "--merge")


def test_a_setting_of_a_method_cannot_hide_a_flag_of_the_group(here: Path, complaint: Callable[..., str]):
    text = constant_agent(here, "0.1").replace(":Constant", ":Mine")
    (here / "constant.py").write_text(
        "from dataclasses import dataclass\n"
        "@dataclass(frozen=True)\nclass Mine:\n    merge: int = 1\n    name = 'mine'\n"
        "    def agent(self, seed): return self\n"
    )
    for command in ("run", "eval"):
        assert f"has a setting 'merge', but {command!r} already has a flag of this name" in complaint(
            command, "--method", text
        )


@pytest.mark.slow
def test_a_share_trains_nothing(here: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]):
    tiny_training.install(tiny_training.write(here / "data"), monkeypatch.setattr)
    words = ("run", "--method", TOY, "--preset", "smoke", "--quiet", "--record", "0", "--split", "test")
    assert "toy-0.1 is not trained for seed 0" in complaint(*words, "--share", "0/2")
    play(words, "--runs", here / "whole")
    play((*words[:-1], "val"), "--runs", here / "runs")
    for share in ("1/2", "0/2"):
        play(words, "--share", share)
    play(words, "--merge")
    whole, merged = (
        json.loads((here / runs / "toy-0.1/synthetic/seed0/result.json").read_text()) for runs in ("whole", "runs")
    )
    assert merged["splits"]["test"] == whole["splits"]["test"]
    assert merged["training"] == whole["training"]
    weights = ("--weights", f"{here}/runs/toy-0.1/synthetic/seed0/weights.safetensors")
    words = ("eval", "--method", TOY, "--quiet", "--preset", "smoke", "--split", "test", *weights)
    play(words, "--runs", here / "alone")
    play_shares(words, 2, here / "together")
    play(words, "--merge", "--runs", here / "together")
    assert contents(here / "together") == contents(here / "alone")


@pytest.mark.slow
def test_shares_verify_a_board_as_one_process_does(here: Path, capsys: pytest.CaptureFixture[str]):
    for method in ("exp", "nothing"):
        play(("run", "--method", method, "--quiet", "--record", "0"))
    assert main.main(["leaderboard", "build", "--runs", "runs", "--board", "board"]) == 0
    result = here / "board/results/nothing/synthetic/seed0/result.json"
    result.write_text(result.read_text().replace("0.0", "1.0", 1))
    words = ["leaderboard", "verify", "--all", "--board", "board", "--quiet", "--threads", "1"]
    capsys.readouterr()
    assert main.main(words) == 1
    unshared = capsys.readouterr().out
    assert "DIFFERS from its episodes" in unshared
    for share in ("1/2", "0/2"):
        assert main.main([*words, "--merge"]) == 2
        assert "the merge lacks" in capsys.readouterr().err
        assert main.main([*words, "--share", share]) == 0
    capsys.readouterr()
    assert main.main([*words, "--merge"]) == 1
    assert capsys.readouterr().out == unshared
    assert not (here / "runs/verify/pieces").exists()


@pytest.mark.slow
def test_a_submission_in_shares_is_the_same_bundle(
    here: Path, monkeypatch: pytest.MonkeyPatch, complaint: Callable[..., str]
):
    agent = constant_agent(here, "0.1", "steady")
    words = ("submit", agent, "--name", "mine", "--seed", "0", "--quiet", "--record", "0", "--timeout", "300")
    play(words, "--runs", here / "whole", "--into", here / "whole.zip")
    for index, machine in enumerate(("here", "there")):
        on_machine(machine, monkeypatch)
        play(words, "--share", f"{index}/2")
    text = complaint(*words, "--merge")
    assert "has pieces of different platforms: Linux, here" in text
    assert "play all pieces on machines of one kind" in text
    on_machine("here", monkeypatch)
    for stamp in here.glob("runs/submissions/**/pieces/unseen*.json"):
        stamp.unlink()
    play(words, "--share", "1/2")
    play(words, "--merge", "--into", here / "merged.zip")
    assert (here / "merged.zip").read_bytes() == (here / "whole.zip").read_bytes()
