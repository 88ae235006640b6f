"""A plan resolves to a run: label, source of reaches, folder, and the training or the shipped weights that it needs."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench.methods import weights
from dextron_bench.methods.weights import MissingWeights
from dextron_bench.runs.plans import Plan, resolve, with_shipped_weights

TOY = "tests.helpers.toy_learner:Toy"
MINJERK_TOY = "tests.helpers.toy_learner:MinjerkToy"
TRANSFER = "tests.helpers.toy_learner:ToyTransfer"


def test_a_method_without_training_needs_no_job():
    run = resolve(Plan("nothing", "synthetic", seed=2))
    assert (run.label, run.source, run.seed, run.learner) == ("nothing", "synthetic", 2, None)
    assert run.training_job(Path("runs")) is None
    assert run.facts.about == {"method": "nothing", "reaches": "synthetic", "seed": 2}
    assert run.folder(Path("runs")).path == Path("runs/nothing/synthetic/seed2")


@pytest.mark.parametrize(
    ("spec", "label", "source", "training_source"),
    [
        (TOY, "toy-0.1", "synthetic", "synthetic"),
        (MINJERK_TOY, "minjerk-toy-0.1", "minjerk", "minjerk"),  # Trains and plays on its own source.
        (TRANSFER, "toy-transfer", "synthetic", "minjerk"),  # Plays the policy of MinjerkToy on other reaches.
    ],
)
def test_a_learner_trains_on_its_source(spec: str, label: str, source: str, training_source: str):
    run = resolve(Plan(spec, "synthetic"))
    assert (run.label, run.source, run.training_source) == (label, source, training_source)
    job = run.training_job(Path("runs"))
    assert job is not None
    assert (job.learner, job.reaches) == (run.learner, training_source)


def test_a_run_with_weights_trains_nothing():
    run = resolve(Plan(TOY, "synthetic")).with_weights(4, Path("seed4.safetensors"))
    assert (run.seed, run.plan.weights) == (4, Path("seed4.safetensors"))
    assert run.training_job(Path("runs")) is None
    assert run.with_seed(5).method is run.method


def test_no_splits_means_all_that_rank_methods():
    assert resolve(Plan("nothing", "synthetic")).splits == ("test", "unseen-reach")
    assert resolve(Plan("nothing", "synthetic", ("val",))).splits == ("val",)


def test_shipped_weights_are_found_by_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    files = {0: tmp_path / "seed0.safetensors", 1: tmp_path / "seed1.safetensors"}
    monkeypatch.setattr(weights, "shipped", lambda learner, reaches: files)
    monkeypatch.setattr(weights, "shipped_labels", lambda learner, reaches: ["toy-0.2"])
    run = resolve(Plan(TOY, "synthetic"))
    assert [(r.seed, r.plan.weights) for r in with_shipped_weights(run, [])] == list(files.items())
    assert [r.seed for r in with_shipped_weights(run, [1])] == [1]
    with pytest.raises(MissingWeights) as caught:
        with_shipped_weights(run, [1, 2])
    assert str(caught.value) == (
        "no weights of 'toy-0.1' on synthetic reaches ship for seed 2; train them with "
        f"`dextron-bench run --method {TOY} --reaches synthetic --seed 2`, or use weights that ship: toy-0.2"
    )


def test_a_method_without_training_has_no_weights():
    with pytest.raises(MissingWeights, match="method 'nothing' has no weights: `dextron-bench run` evaluates it"):
        with_shipped_weights(resolve(Plan("nothing", "synthetic")), [0])
