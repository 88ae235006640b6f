"""Weights from files and weights that ship, from the command line, and one line for each error."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save_file

from dextron_bench.storage import tensors
from dextron_bench.world import model
from tests.helpers import toy_learner
from tests.helpers.tiny_training import TOY

SHAPE = model.STATE


@pytest.fixture
def here(training_world: Path) -> Path:
    return training_world


def train(spec: str, *words: str) -> list[str]:
    common = ["--quiet", "--record", "0", "--split", "test", "--preset", "smoke"]
    return ["run", "--method", spec, *common, *words]


def evaluate(*words: str) -> list[str]:
    return ["eval", "--method", TOY, "--quiet", "--split", "test", *words]


def test_weights_of_a_file_give_the_row_of_its_run(here: Path, printed_json: Callable[..., Any]):
    trained = printed_json(*train(TOY, "--seed", "4"))
    file = here / "runs" / "toy-0.1" / "synthetic" / "seed4" / "weights.safetensors"
    assert printed_json(*evaluate("--weights", str(file))) == trained
    assert (here / "runs" / "eval" / "toy-0.1" / "synthetic" / "seed4" / "result.json").exists()
    assert len(printed_json("leaderboard", "show")) == 1  # Evaluations of weights do not count.


@pytest.mark.slow
def test_weights_that_ship_lie_beside_the_method(
    here: Path, printed_json: Callable[..., Any], complaint: Callable[..., str]
):
    (here / "toy.py").write_text(Path(toy_learner.__file__).read_text())
    words = ["eval", "--method", "toy.py:Toy", "--quiet", "--split", "test"]
    assert (
        "no weights of 'toy-0.2' on synthetic reaches ship for seed 0; train them with `dextron-bench run --method "
        "toy.py:Toy --rate 0.2 --reaches synthetic --seed 0`"
    ) in complaint(*words, "--rate", "0.2")
    trained = printed_json(*train("toy.py:Toy", "--seed", "0", "2"))
    for seed in (0, 2):
        place = here / "weights" / "toy-0.1" / "synthetic" / f"seed{seed}.safetensors"
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes((here / f"runs/toy-0.1/synthetic/seed{seed}/weights.safetensors").read_bytes())
    assert printed_json(*words) == trained
    assert "ship for seed 1; train them" in complaint(*words, "--seed", "0", "1")
    assert "--rate 0.2 --reaches synthetic --seed 0`, or use weights that ship: toy-0.1" in complaint(
        *words, "--rate", "0.2"
    )


def damaged(folder: Path, kind: str) -> Path:
    """A broken file of weights."""
    file, good = folder / f"{kind}.safetensors", {"map": np.zeros(SHAPE), "offset": np.zeros(())}
    writers: dict[str, Callable[[], object]] = {
        "missing": lambda: None,
        "empty": lambda: file.write_bytes(b""),
        "pickle": lambda: file.write_bytes(pickle.dumps(good)),
        "header": lambda: file.write_bytes(b"\xff" * 8 + b"{}"),
        "nested": lambda: file.write_bytes((200000).to_bytes(8, "little") + b"[" * 200000),
        "cut": lambda: (save_file(good, file), file.write_bytes(file.read_bytes()[:-8])),
        "shape": lambda: save_file(good | {"map": np.zeros(3)}, file),
        "names": lambda: save_file({"other": np.zeros(3)}, file),
        "nan": lambda: save_file(good | {"map": np.full(SHAPE, np.nan)}, file),
        "other": lambda: tensors.write(file, good, {"label": "bc"}),
        "folder": file.mkdir,
    }
    writers[kind]()
    return file


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("missing", "No such file or directory: missing.safetensors"),
        ("empty", "empty.safetensors is damaged or not a safetensors file"),
        ("pickle", "pickle.safetensors is damaged or not a safetensors file"),
        ("header", "header.safetensors is damaged or not a safetensors file"),
        ("nested", "nested.safetensors is damaged or not a safetensors file"),
        ("cut", "cut.safetensors is damaged or not a safetensors file"),
        ("shape", "shape.safetensors holds no weights that fit 'toy-0.1' (ValueError: matmul"),
        ("names", "names.safetensors holds no weights that fit 'toy-0.1' (KeyError: 'map')"),
        ("nan", "nan.safetensors holds numbers in 'map' that are not finite"),
        ("other", "other.safetensors holds weights of 'bc', not of 'toy-0.1'"),
        ("folder", "folder.safetensors"),
    ],
)
def test_a_broken_file_of_weights_is_one_line(here: Path, complaint: Callable[..., str], kind: str, expected: str):
    assert expected in complaint(*evaluate("--weights", damaged(here, kind).name))
    assert not (here / "runs").exists()


def test_an_impossible_evaluation_is_one_line(here: Path, complaint: Callable[..., str]):
    assert "method 'exp' has no weights" in complaint("eval", "--method", "exp")
    file = damaged(here, "other").name
    assert "method 'exp' has no weights" in complaint("eval", "--method", "exp", "--weights", file)
    assert "give one --seed, or none" in complaint(*evaluate("--weights", file, "--seed", "0", "1"))
