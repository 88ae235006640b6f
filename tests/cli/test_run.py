"""Methods with training, from the command line: flags, files, labels, and one line for each error."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from dextron_bench.cli import main
from dextron_bench.methods import loading
from dextron_bench.runs import result_files
from dextron_bench.storage import hashing, tensors
from tests.helpers import tiny_training
from tests.helpers.tiny_training import MINJERK_TOY, TOY, TRANSFER

FAST = ("--quiet", "--record", "0")


@pytest.fixture
def here(training_world: Path) -> Path:
    return training_world


def run(spec: str, *words: str) -> list[str]:
    return ["run", "--method", spec, *FAST, "--split", "test", "--preset", "smoke", *words]


def test_a_run_trains_all_seeds_together(
    here: Path, printed_json: Callable[..., Any], capsys: pytest.CaptureFixture[str]
):
    (row,) = printed_json(*run(TOY, "--seed", "0", "1", "--rate", "0.3"))
    assert (row["method"], row["seeds"], row["episodes"]) == ("toy-0.3", 2, 4)
    base = here / "runs" / "toy-0.3" / "synthetic"
    assert sorted(path.name for path in base.iterdir()) == ["seed0", "seed1", "training-0+1"]
    result = json.loads((base / "seed1" / "result.json").read_text())
    training = result["training"]
    assert (training["seeds"], training["epochs"], training["best_epoch"], training["frames"]) == ([0, 1], 2, 2, 40)
    assert training["sha256"] == hashing.sha256(base / "seed1" / "weights.safetensors")
    assert [point["epoch"] for point in json.loads((base / "seed1" / "curve.json").read_text())["points"]] == [2]
    assert main.main(["runs", "list"]) == 0
    assert "toy-0.3" in capsys.readouterr().out


@pytest.mark.slow
def test_seeds_that_are_trained_are_not_trained_again(here: Path, printed_json: Callable[..., Any]):
    assert main.main(run(TOY, "--seed", "1")) == 0
    before = tiny_training.contents(here / "runs" / "toy-0.1" / "synthetic" / "seed1")
    (row,) = printed_json(*run(TOY, "--seed", "0", "1", "2"))
    assert row["seeds"] == 3
    base = here / "runs" / "toy-0.1" / "synthetic"
    assert sorted(path.name for path in base.glob("training-*")) == ["training-0+2", "training-1"]
    assert tiny_training.contents(base / "seed1") == before


def test_a_policy_transfer_acts_with_the_weights_of_its_source_policy(
    here: Path, printed_json: Callable[..., Any], capsys: pytest.CaptureFixture[str]
):
    (row,) = printed_json(*run(TRANSFER))
    assert (row["method"], row["reaches"]) == ("toy-transfer", "synthetic")
    source_policy = here / "runs" / "minjerk-toy-0.1" / "minjerk" / "seed0"
    transfer = here / "runs" / "toy-transfer" / "synthetic" / "seed0"
    assert (source_policy / "weights.safetensors").read_bytes() == (transfer / "weights.safetensors").read_bytes()
    assert json.loads((transfer / "result.json").read_text())["training"]["label"] == "minjerk-toy-0.1"
    (row,) = printed_json(*run(MINJERK_TOY))
    assert (row["method"], row["reaches"]) == ("minjerk-toy-0.1", "minjerk")
    arrays = tensors.read(source_policy / "weights.safetensors")
    tensors.write(source_policy / "weights.safetensors", arrays, {"label": "minjerk-toy-0.1", "seed": 1})
    assert main.main(run(TRANSFER)) == 2
    assert "holds a run with other weights" in capsys.readouterr().err


@pytest.mark.slow
def test_a_dry_run_prints_what_is_left_and_writes_nothing(
    here: Path, printed_json: Callable[..., Any], capsys: pytest.CaptureFixture[str]
):
    words = [*run(TOY, "--seed", "0", "1"), "--dry-run"]
    train, play = printed_json(*words)
    assert (train["what"], train["left"], train["seeds"]) == ("train", "2 of 2 epochs", [0, 1])
    assert 0 < train["seconds"] < 60
    assert (play["what"], play["left"]) == ("evaluate", "4 episodes")
    assert 0 < play["seconds"] < 60
    assert not (here / "runs").exists()
    assert main.main([*run(TOY, "--breaks", "2", "--every", "1")]) == 2
    train, _ = printed_json(*run(TOY, "--breaks", "2", "--every", "1"), "--dry-run")
    assert train["left"] == "1 of 2 epochs"
    assert main.main(["runs", "list"]) == 0
    assert "1 of 2 epochs" in capsys.readouterr().out
    assert main.main(words[:-1]) == 2  # The folder has a run with other settings.
    assert main.main([*run(TOY, "--runs", "other")]) == 0
    assert printed_json(*run(TOY, "--runs", "other"), "--dry-run") == []
    assert main.main([*run(TOY, "--runs", "other"), "--dry-run"]) == 0


def test_flags_of_a_method_are_in_the_help(here: Path, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as caught:
        main.main(["run", "--method", TOY, "--help"])
    assert caught.value.code == 0
    printed = capsys.readouterr().out
    assert "--rate" in printed
    assert "Learning rate." in printed
    assert "--seed" in printed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--nosuch", "1"], "unknown flag --nosuch"),
        (["--rate", "x"], "--rate: 'x' is not a number; see `dextron-bench run --h"),
        (["--rate", "-1"], "--rate is -1; a learning rate is positive"),
        (
            ["--preset", "no"],
            "--preset: 'no' is not one of paper, quick, smoke; see",
        ),
        (["--split", "tset"], "no split 'tset' of 'synthetic' reaches"),
        (["--breaks", "1"], "epoch 1 of method 'toy-0.1' raised ZeroDivisionError: toys break"),
        (["--spoils", "1"], "diverged: 'loss' of seed 0 is nan in epoch 1; there is no checkpoint yet in runs/toy-0.1"),
        (["--every", "0"], "needs at least one epoch and a period of at least one"),
        (["--device", "cuda"], "this machine has no CUDA device"),
    ],
)
def test_an_error_is_one_line(
    here: Path, complaint: Callable[..., str], monkeypatch: pytest.MonkeyPatch, words: list[str], expected: str
):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert expected in complaint(*run(TOY), *words)
    assert not list(here.rglob("result.json"))


ODD = """
from dataclasses import dataclass
@dataclass(frozen=True)
class Odd:
    name = "odd"
    {field}
    def agent(self, seed): ...
"""


@pytest.mark.parametrize(
    ("field", "expected"),
    [
        ("seed: int = 0", "has a setting 'seed', but 'run' already has a flag of this name"),
        ("size: int", "method 'odd.py:Odd': "),
        ("label: str = '../up'", "has the label '../up'"),
        ("size: int = 1\n    def __post_init__(self): raise KeyError('oh')", "method 'odd.py:Odd': 'oh'"),
    ],
)
def test_settings_that_cannot_be_flags_are_one_line(
    here: Path, complaint: Callable[..., str], field: str, expected: str
):
    (here / "odd.py").write_text(ODD.format(field=field))
    assert expected in complaint("run", "--method", "odd.py:Odd", *FAST)


@pytest.mark.slow
def test_published_rows_of_the_same_splits_and_physics_stand_beside_the_new_ones(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def origins() -> dict[str, str]:
        """Where each row of the table that a run of NOTHING prints comes from, by method."""
        capsys.readouterr()
        assert main.main(["run", "--method", "nothing", "--record", "0", "--split", "test"]) == 0
        cells = [[cell.strip() for cell in line.split("│")] for line in capsys.readouterr().out.splitlines()]
        return {line[1]: line[-2] for line in cells if len(line) > 4}

    assert main.main(["run", "--method", "exp", "--record", "0", "--runs", "board"]) == 0
    monkeypatch.setattr(result_files, "published_results", lambda: here / "board")
    assert origins() == {"exp": "published", "nothing": "this run"}
    file = here / "board/exp/synthetic/seed0/result.json"
    result = json.loads(file.read_text())
    result["provenance"]["physics"] = "another"
    file.write_text(json.dumps(result))
    assert origins() == {"nothing": "this run"}


@pytest.mark.slow
def test_every_configuration_has_a_folder_and_a_row(
    here: Path, printed_json: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
):
    """Two settings, and then another version of the file: four runs side by side, and each is read again."""
    text = ODD.format(field="near: float = 0.1").replace(
        "...", "from baselines.floors import Nothing; return Nothing().agent(seed)"
    )

    def labels(*flags: str) -> list[str]:
        for name in [name for name in sys.modules if name.startswith(loading.PREFIX)]:
            monkeypatch.delitem(sys.modules, name)  # A new process would load the file again.
        words = ["run", "--method", "odd.py:Odd", *flags, "--record", "0", "--split", "test", "--quiet"]
        return [row["method"] for row in printed_json(*words)]

    (here / "odd.py").write_text(text)
    assert labels() + labels("--near", "0.2") + labels() == ["odd", "odd-near0.2", "odd"]
    (here / "odd.py").write_text(text + "# Changed.\n")
    digest = hashing.sha256(here / "odd.py")[:8]
    assert labels() + labels("--near", "0.2") + labels() == [f"odd+{digest}", f"odd-near0.2+{digest}", f"odd+{digest}"]
    (here / "odd.py").write_text(text)
    assert labels() == ["odd"]
    assert len(printed_json("leaderboard", "show")) == 4


@pytest.mark.slow
def test_tracks_are_rows_beside_the_plain_ones(
    here: Path, printed_json: Callable[..., Any], capsys: pytest.CaptureFixture[str]
):
    words = ["run", "--method", "exp", *FAST, "--split", "test"]
    by_split = {row["split"]: row["return"] for row in printed_json(*words, "--track", "delay-40", "sensing-2")}
    assert by_split.keys() == {"test", "test+delay-40", "test+sensing-2"}
    assert by_split["test"] == 20.0
    assert [row["split"] for row in printed_json(*words)] == ["test"]
    assert len(printed_json("leaderboard", "show")) == 3
    capsys.readouterr()
    assert main.main([*words, "--track", "nix"]) == 2
    assert "no track 'nix'; choose from delay-40" in capsys.readouterr().err
