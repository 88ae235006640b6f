"""The tiny benchmark with training: rows of `train`, minimum-jerk reaches (the same short ones) and a toy learner."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.experts.policies import Case
from dextron_bench.methods.learners import Learner, TrainingSetup
from dextron_bench.reaches import sources
from dextron_bench.splits.loading import Split, load_split
from dextron_bench.training import loop
from dextron_bench.training.checkpoints import Checkpoints
from tests.helpers import tiny_benchmark
from tests.helpers.short_reaches import SOURCE
from tests.helpers.toy_learner import Linear, Toy

TRAIN = pd.DataFrame(
    [("train", *tiny_benchmark.SOLVED[0]), ("train", *tiny_benchmark.SOLVED[1])], columns=tiny_benchmark.COLUMNS
)
TOY = f"{Path(__file__).with_name('toy_learner.py')}:Toy"
MINJERK_TOY, TRANSFER = TOY.replace(":Toy", ":MinjerkToy"), TOY.replace(":Toy", ":ToyTransfer")
QUICK = Toy(preset="quick")  # 5 epochs, checkpoints after 2, 4 and 5.
SEEDS = (0, 3)
TIMES = {"timing.jsonl", "provenance.json", "times.json"}  # Files that depend on time and machine.


class Killed(BaseException):
    """Stands for the end of the process."""


def write(folder: Path) -> Path:
    """Writes the catalogue and the tables of the splits of two sources into a folder; returns the folder."""
    tiny_benchmark.write(folder, pd.concat([tiny_benchmark.ROWS, TRAIN]))
    catalogue = json.loads((folder / "splits.json").read_text())
    (folder / "splits.json").write_text(json.dumps({**catalogue, "minjerk": catalogue[tiny_benchmark.NAME]}))
    (folder / "splits-minjerk.parquet").write_bytes((folder / f"splits-{tiny_benchmark.NAME}.parquet").read_bytes())
    return folder


def install(folder: Path, put: Callable[[object, str, object], None]) -> None:
    """Replaces the shipped splits and sources; `put` sets attributes, as `setattr` does."""
    tiny_benchmark.install(folder, put)
    put(sources, "SOURCES", {**sources.SOURCES, "minjerk": lambda: SOURCE})


@contextmanager
def working_folder(folder: Path) -> Iterator[Path]:
    """Makes a folder the working folder of the tiny benchmark with training, which it keeps in data/."""
    import pytest

    with tiny_benchmark.working_folder(folder), pytest.MonkeyPatch.context() as patch:
        install(write(folder / "data"), patch.setattr)
        yield folder


def contents(folder: Path) -> dict[str, bytes]:
    """The files that must not depend on interruptions; a result without its provenance."""
    files = {}
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.name not in TIMES and file.suffix != ".rrd":
            content = file.read_bytes()
            if file.name == "result.json":
                content = json.dumps(json.loads(content) | {"provenance": None}).encode()
            files[str(file.relative_to(folder))] = content
    return files


def artificial_scores(agent: Linear, source: object, cases: Sequence[Case], **_: object) -> Iterator[tuple[int, Any]]:
    """Replaces `rollout`: scores that depend on the weights alone, without a simulation."""
    for row in range(len(cases)):
        score = float(np.round(np.abs(agent._map).sum() * 7 + agent._offset) % 20)
        yield row, SimpleNamespace(score=score, actions=np.full((3, 1), score / 20))


def train(
    folder: Path, learner: Learner = QUICK, device: str = "cpu", val: Split | None = None, **options: Any
) -> Checkpoints:
    """Trains SEEDS in a folder."""
    setup = TrainingSetup(SOURCE, load_split("synthetic", "train").cases, folder / "cache", threads=1, device=device)
    return loop.train(learner, setup, SEEDS, folder, val or load_split("synthetic", "val"), **options)
