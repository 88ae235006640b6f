"""Training: cut off at any write it ends with the same bytes; which snapshot is best; what is told of damage."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.learners import Learner, PolicyTransfer, Track
from dextron_bench.splits.loading import load_split
from dextron_bench.storage import atomic, provenance, tensors
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.folder_config import FolderMismatch
from dextron_bench.training import learning_curve, loop, timing
from dextron_bench.training.checkpoints import Busy, Checkpoints
from dextron_bench.training.loop import Diverged
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.toy_learner import Linear, Toy, ToyTrainer

QUICK = Toy(preset="quick")  # 5 epochs, checkpoints after 2, 4 and 5.
SEEDS = (0, 3)


class Killed(BaseException):
    """What ends a process here."""


def score(agent: Linear, source: object, cases: list, **_: object) -> Iterator[tuple[int, Any]]:
    """Stands in for `rollout`: made-up scores that depend on the weights."""
    for index in range(len(cases)):
        yield index, SimpleNamespace(score=float(np.round(np.abs(agent._map).sum() * 7 + agent._offset) % 20))


@pytest.fixture(autouse=True)
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Tiny splits, scores that cost nothing, and a provenance that no one's commit changes meanwhile."""
    tiny_training.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.setattr(provenance, "collect", lambda physics: {"git": "abc"})
    monkeypatch.setattr(learning_curve, "rollout", score)
    monkeypatch.setattr(os, "fsync", lambda descriptor: None)
    yield
    tiny_benchmark.forget()


def train(folder: Path, learner: Any = QUICK, device: str = "cpu", **options: Any) -> Checkpoints:
    cases = load_split("synthetic", "train").cases
    track = Track(tiny_benchmark.SOURCE, cases, folder / "cache", threads=1, device=device)
    return loop.train(learner, track, SEEDS, folder, load_split("synthetic", "val"), **options)


def test_toys_are_what_the_contract_asks_for():
    assert isinstance(QUICK, Learner)
    assert not isinstance(QUICK, PolicyTransfer)


def test_a_training_leaves_checkpoint_metrics_and_snapshots(tmp_path: Path):
    told = []
    done = train(tmp_path / "a", report=lambda *parts: told.append(parts))
    assert done.epochs() == [2, 4, 5]
    assert [(row["epoch"], row["seed"]) for row in done.metrics()] == [(e, s) for e in range(1, 6) for s in SEEDS]
    about = tensors.read_about(done.snapshot(4, 3))
    assert (about["label"], about["seed"], about["seeds"], about["epoch"], about["frames"]) == (
        "toy-0.1", 3, [0, 3], 4, 80.0,
    )  # fmt: skip
    assert not (tmp_path / "a" / "journals").exists()
    assert [part[:2] for part in told] == [(n, 5) for n in (0, 1, 2, 2, 3, 4, 4, 5, 5, 5, 5)]
    assert told[0][2] == ""
    assert told[-3][2].startswith("val ")
    assert [part[2] for part in told[-2:]] == [f"choosing between the 5 best of seed {seed}" for seed in SEEDS]


def test_again_it_computes_nothing_and_changes_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    train(tmp_path / "a")
    before = tiny_training.contents(tmp_path / "a")
    for name in ("__init__", "advance"):
        monkeypatch.setattr(ToyTrainer, name, None)
    monkeypatch.setattr(learning_curve, "rollout", None)
    train(tmp_path / "a")
    assert tiny_training.contents(tmp_path / "a") == before


def test_cut_off_before_and_after_every_write_it_ends_with_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    train(tmp_path / "whole")
    whole = tiny_training.contents(tmp_path / "whole")
    write_whole = atomic.write_atomically
    writes = 0
    for writes in range(1000):
        folder, left = tmp_path / f"cut{writes}", [writes]

        def cut(file: Path, write: Any, left: list[int] = left) -> None:
            left[0] -= 2
            if left[0] == -2:  # An even number: before the write, with a half-written file left behind.
                file.parent.mkdir(parents=True, exist_ok=True)
                file.with_name(f".{file.name}.1.part").write_bytes(b"half")
                raise Killed
            write_whole(file, write)
            if left[0] == -1:
                raise Killed

        with monkeypatch.context() as patched:
            patched.setattr(atomic, "write_atomically", cut)
            try:
                train(folder)
                break
            except Killed:
                pass
        done = Checkpoints(folder, SEEDS).progress()
        if (folder / "metrics.jsonl").exists() and not (done and done.over):
            with (folder / "metrics.jsonl").open("a") as file:
                file.write('{"epoch": 5, "lo')
        train(folder)
        assert tiny_training.contents(folder) == whole, writes
    assert writes == 2 * (2 + 3 * 6)  # Two files at the start, six in each period.


def test_a_training_depends_on_journal_and_streams(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """So that the test above would see it if one of them were lost."""
    begun = ToyTrainer(QUICK, 2, SEEDS)
    for _ in range(2):
        begun.advance()
    journal, state = begun.journal(), begun.state()
    losses = begun.advance()
    for spoilt in ({"lived": journal["lived"][:, ::-1]}, None):
        again = ToyTrainer(QUICK, 2, SEEDS)
        copy = {name: array.copy() for name, array in state.items()}
        if spoilt is None:
            copy["streams"][:, 1] += 1
        again.restore(copy, [spoilt or journal])
        assert again.advance() != losses


def test_of_equal_snapshots_the_later_is_the_best(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(learning_curve, "FINALISTS", 2)
    monkeypatch.setattr(learning_curve, "POINT_ROWS", 1)
    monkeypatch.setitem(globals(), "load_split", lambda *_, load=load_split: load("synthetic", "test"))
    done = train(tmp_path / "a", Toy(every=1, preset="quick"))
    made = learning_curve.Curve(QUICK, done, tiny_benchmark.SOURCE, load_split("synthetic", "val"))
    points = {1: 9.0, 2: 4.0, 3: 9.0, 4: 9.0, 5: 8.0}  # Of the first row.
    finals = {1: [20.0, 20.0], 3: [9.0, 5.0], 4: [9.0, 5.0]}
    for epoch in points:
        write_scores(done, epoch, 1, [points[epoch]])
        write_scores(done, epoch, 2, finals.get(epoch, [0.0, 0.0]))
    assert made.best(0) == 4  # 1 would be better on all of `val`, but 3 and 4 are the finalists.
    write_scores(done, 3, 2, [9.0, 6.0])
    made = learning_curve.Curve(QUICK, done, tiny_benchmark.SOURCE, load_split("synthetic", "val"))
    assert made.best(0) == 3
    assert made.points(0)[1] == {"epoch": 2, "return": 4.0, "success": 0.0}


def write_scores(done: Checkpoints, epoch: int, rows: int, scores: list[float]) -> None:
    file = done.snapshot(epoch, 0).with_name(f"seed0-val{rows}.json")
    atomic.write_json(file, {"digest": load_split("synthetic", "val").digest, "scores": scores})


def test_scores_on_another_version_of_val_do_not_count(tmp_path: Path):
    done = train(tmp_path / "a")
    file = done.snapshot(2, 0).with_name("seed0-val1.json")
    before = file.read_bytes()
    file.write_text(json.dumps({"digest": "old", "scores": [0.0]}))
    train(tmp_path / "a")
    assert file.read_bytes() == before


def test_numbers_that_are_not_finite_end_it_with_the_last_good_checkpoint(tmp_path: Path):
    for _ in range(2):
        with pytest.raises(Diverged) as caught:
            train(tmp_path / "a", Toy(preset="quick", spoils=5))
        assert str(caught.value) == (
            "training of 'toy-0.1' diverged: 'loss' of seed 3 is nan in epoch 5; the last good checkpoint is at "
            f"epoch 4 in {tmp_path / 'a'}"
        )
    with pytest.raises(Diverged, match="in epoch 1; there is no checkpoint yet"):
        train(tmp_path / "b", Toy(preset="quick", spoils=1))


def test_a_trainer_that_raises_or_returns_too_little_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(AgentError, match=r"epoch 3 of method 'toy-0\.1' raised ZeroDivisionError: toys break"):
        train(tmp_path / "a", Toy(preset="quick", breaks=3))
    monkeypatch.setattr(ToyTrainer, "advance", lambda self: [])
    with pytest.raises(AgentError, match="for each of 2 seeds; it went from epoch 0 to 0 with 0"):
        train(tmp_path / "b")
    with pytest.raises(AgentError, match="a period of at least one; it has 5 and 0"):
        train(tmp_path / "c", Toy(preset="quick", every=0))


def half_done(folder: Path) -> Path:
    """A training that stopped in its fifth epoch."""
    with pytest.raises(AgentError):
        train(folder, Toy(preset="quick", breaks=5))
    return folder


@pytest.mark.parametrize(
    "name", ["checkpoint.safetensors", "journals/000002.safetensors", "metrics.jsonl", "config.json"]
)
def test_damage_is_named_with_what_to_do(tmp_path: Path, name: str):
    folder = half_done(tmp_path / "a")
    file = folder / name
    file.write_bytes(file.read_bytes()[: 20 if name != "checkpoint.safetensors" else -20])
    with pytest.raises(DamagedFile, match=r"is damaged .*; remove it and run again") as caught:
        train(folder, Toy(preset="quick", breaks=5))
    assert str(folder) in str(caught.value)


def test_a_damaged_snapshot_is_named(tmp_path: Path):
    done = train(tmp_path / "a")
    done.snapshot(2, 0).write_bytes(b"not weights")
    done.snapshot(2, 0).with_name("seed0-val1.json").unlink()
    with pytest.raises(DamagedFile, match=r"epoch-0002/seed0\.safetensors is damaged"):
        train(tmp_path / "a")


def test_other_settings_and_another_device_do_not_go_on(tmp_path: Path):
    folder = half_done(tmp_path / "a")
    with pytest.raises(FolderMismatch, match="holds another run: it differs in settings"):
        train(folder, Toy(preset="paper"))
    with pytest.raises(FolderMismatch, match="was begun on cpu: go on with --device cpu, or remove it"):
        train(folder, Toy(preset="quick", breaks=5), device="cuda")


def test_two_processes_do_not_train_in_one_folder(tmp_path: Path):
    done = Checkpoints(tmp_path / "a", SEEDS)
    with done.locked(), pytest.raises(Busy, match="another process is training in"):
        train(tmp_path / "a")
    train(tmp_path / "a")


def test_time_left_is_that_of_the_middle_epoch_and_evaluation(tmp_path: Path):
    assert timing.seconds_left(tmp_path, 10, 2) is None
    rows = [("epoch", 2.0), ("epoch", 3.0), ("epoch", 100.0), ("evaluation", 1.0)]
    lines = [json.dumps({"what": what, "seconds": seconds}) for what, seconds in rows]
    (tmp_path / "timing.jsonl").write_text("\n".join([*lines, '{"what": "ep']))
    assert timing.seconds_left(tmp_path, 11, 2) == 11 * 3.0 + 6 * 1.0
