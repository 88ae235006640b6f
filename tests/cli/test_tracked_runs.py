"""`run --tracker`: a second command on a training that is going on leaves the first one's tracking as it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dextron_bench.training.checkpoints import Checkpoints
from tests.helpers.tiny_training import TOY


def test_a_training_that_is_going_on_keeps_its_tracking(training_world: Path, complaint: Callable[..., str]):
    source = training_world / "runs/toy-0.1/synthetic"
    counts = source / "tracking-0/tensorboard.json"
    counts.parent.mkdir(parents=True)
    counts.write_text("{}")
    with Checkpoints(source / "training-0", [0]).locked():
        words = ("--method", TOY, "--preset", "quick", "--seed", "0", "--record", "0", "--tracker", "tensorboard")
        assert "another process is training in" in complaint("run", *words)
    assert counts.read_text() == "{}"
    assert [file.name for file in counts.parent.iterdir()] == [counts.name]
