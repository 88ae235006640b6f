"""What it costs to keep episodes, to record them, to read them back, and to ask the success model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from rerun.chunk import RrdReader

from dextron_bench import recording
from dextron_bench.evaluation import episode_table, episodes
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.runs import run_files
from dextron_bench.splits.loading import Split
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.success.network import SIZES, SuccessModel
from dextron_bench.success.predict import predict
from tests.benchmarks.measure import Row, alone, in_turns, note, scaled
from tests.benchmarks.workload import Prepared, cases

ROUNDS, EPISODES, FILES = 3, 32, 200


def model() -> SuccessModel:
    """A success model that knows nothing; it takes as long as one that does."""
    rng = np.random.default_rng(0)
    layers = {f"layer.{i}": rng.normal(size=shape) / shape[-1] ** 0.5 for i, shape in enumerate(SIZES)}
    return SuccessModel(layers | {"mean": np.zeros(48), "deviation": np.ones(48)})


class LiveView:
    """Episodes as they are rolled out, and ways to keep them."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.cases, self.model = folder, cases(scaled(EPISODES)), model()
        self.source = Prepared(self.cases)
        self.episodes: dict[int, episodes.Episode] = {}

    def play(self) -> None:
        """Rolls them out, on all cores."""
        self.episodes = dict(rollout(ExpertAgent(), self.source, self.cases))

    def keep(self) -> None:
        """Writes the table of a run, from which each can be played again."""
        split = Split("test", self.source.name, tuple(self.cases), "")
        rows = [episode_table.row(split, index, self.episodes[index]) for index in range(len(self.cases))]
        run_files.store_episodes(RunFolder(self.folder), pd.DataFrame(rows))

    def record(self) -> None:
        """Writes recordings."""
        for index, each in self.episodes.items():
            recording.write(self.folder / f"{index}.rrd", each, self.source.path(each.setting), {"row": index})

    def explain(self) -> None:
        """Writes recordings that show what the success model thinks."""
        for index, each in self.episodes.items():
            seen = predict(self.model, self.source, self.cases[index], each)
            recording.write(self.folder / f"{index}.rrd", each, self.source.path(each.setting), {"row": index}, seen)


@pytest.mark.parametrize(
    ("way", "what"),
    [
        ("keep", "Episodes kept in `episodes.parquet`, to be played again"),
        ("record", "Episodes recorded"),
        ("explain", "Episodes recorded with the success model's curves"),
    ],
)
def test_keeping_against_rollout(benchmark: BenchmarkFixture, tmp_path: Path, way: str, what: str):
    stage = LiveView(tmp_path)
    seconds, rolled = in_turns(benchmark, getattr(stage, way), stage.play, ROUNDS)
    rates = len(stage.cases) / seconds, len(stage.cases) / rolled
    note(benchmark, Row(what, "episodes/s", rates[0], "episodes rolled out, all cores", rates[1]))


def test_reading_scalars_back(benchmark: BenchmarkFixture, tmp_path: Path):
    stage = LiveView(tmp_path)
    stage.play()
    stage.record()
    files = [tmp_path / f"{number % len(stage.cases)}.rrd" for number in range(scaled(FILES))]

    def read() -> None:
        for file in files:
            stream = RrdReader(file).store().stream().filter(content="/episode/rewards")
            assert any(chunk.num_rows for chunk in stream.to_chunks())

    note(benchmark, Row("Rewards read back from recordings", "files/s", len(files) / alone(benchmark, read, ROUNDS)))


@pytest.mark.parametrize("count", [1, 16, 256])
def test_curves_of_the_success_model(benchmark: BenchmarkFixture, count: int):
    judge, states = model(), np.random.default_rng(1).normal(size=(count, 48))
    seconds = alone(benchmark, lambda: judge.curve(states), 20)
    what = f"Success curves of 51 actions, {count} state{'s'[: count - 1]} at once"
    note(benchmark, Row(what, "calls/s", 1.0 / seconds, "control steps of 20 ms", 50.0))
