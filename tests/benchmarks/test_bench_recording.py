"""The cost of storing episodes, recording them, reading them back, and predicting their success."""

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
from dextron_bench.runs.recorder import Recorder
from dextron_bench.splits.loading import Split
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.success.network import SIZES, SuccessModel
from dextron_bench.success.predict import predict
from tests.benchmarks.measure import Row, scaled, store_rows, time_in_turns, time_work
from tests.benchmarks.workload import PreparedSource, draw_cases

ROUNDS, EPISODES, RECORDED, FILES = 3, 32, 500, 200


def model() -> SuccessModel:
    """A success model with random weights, which is as fast as a trained one."""
    rng = np.random.default_rng(0)
    layers = {f"layer.{i}": rng.normal(size=shape) / shape[-1] ** 0.5 for i, shape in enumerate(SIZES)}
    return SuccessModel(layers | {"mean": np.zeros(48), "deviation": np.ones(48)})


class Workbench:
    """Rolls episodes out and stores them in several ways."""

    def __init__(self, folder: Path, count: int) -> None:
        self.folder, self.cases, self.model = folder, draw_cases(count), model()
        self.source = PreparedSource(self.cases)
        self.episodes: dict[int, episodes.Episode] = {}

    def play(self) -> None:
        """Rolls the episodes out on all cores."""
        self.episodes = dict(rollout(ExpertAgent(), self.source, self.cases))

    def keep(self) -> None:
        """Writes the table of a run, which is sufficient to replay each episode."""
        split = Split(name="test", reaches=self.source.name, digest="", cases=tuple(self.cases))
        rows = [episode_table.row(split, index, self.episodes[index]) for index in range(len(self.cases))]
        run_files.store_episodes(RunFolder(self.folder), pd.DataFrame(rows))

    def record(self) -> None:
        """Writes recordings."""
        for index, episode in self.episodes.items():
            path = self.source.path(episode.setting)
            recording.write(self.folder / f"{index}.rrd", episode, path, {"row": index})

    def record_predictions(self) -> None:
        """Writes recordings with the predictions of the success model."""
        for index, episode in self.episodes.items():
            path = self.source.path(episode.setting)
            predictions = predict(self.model, self.source, self.cases[index], episode)
            recording.write(self.folder / f"{index}.rrd", episode, path, {"row": index}, predictions)


@pytest.mark.parametrize(
    ("way", "what"),
    [
        ("keep", "Episodes stored in `episodes.parquet`, sufficient for a replay"),
        ("record", "Episodes recorded"),
        ("record_predictions", "Episodes recorded with the success model's curves"),
    ],
)
def test_storing_compared_with_rollout(benchmark: BenchmarkFixture, tmp_path: Path, way: str, what: str):
    workbench = Workbench(tmp_path, scaled(EPISODES))
    seconds, rolled = time_in_turns(benchmark, getattr(workbench, way), workbench.play, ROUNDS)
    rates = len(workbench.cases) / seconds, len(workbench.cases) / rolled
    store_rows(benchmark, Row(what, "episodes/s", rates[0], "episodes rolled out, all cores", rates[1]))


def test_reading_scalars_back(benchmark: BenchmarkFixture, tmp_path: Path):
    workbench = Workbench(tmp_path, scaled(EPISODES))
    workbench.play()
    workbench.record()
    files = [tmp_path / f"{number % len(workbench.cases)}.rrd" for number in range(scaled(FILES))]

    def read() -> None:
        for file in files:
            stream = RrdReader(file).store().stream().filter(content="/episode/rewards")
            assert any(chunk.num_rows for chunk in stream.to_chunks())

    seconds = time_work(benchmark, read, ROUNDS)
    store_rows(benchmark, Row("Rewards read back from recordings", "files/s", len(files) / seconds))


def test_recording_beside_the_rollout(benchmark: BenchmarkFixture, tmp_path: Path):
    workbench = Workbench(tmp_path, scaled(RECORDED))
    cases, source = workbench.cases, workbench.source

    def play_and_record() -> None:
        with Recorder(source, len(cases)) as recorder:
            for index, episode in rollout(ExpertAgent(), source, cases):
                recorder.write(tmp_path / f"{index}.rrd", cases[index], episode, {"row": index})
            assert len(recorder.hashes()) == len(cases)

    seconds, rolled = time_in_turns(benchmark, play_and_record, workbench.play, 1)
    rates = len(cases) / seconds, len(cases) / rolled
    what = f"{len(cases)} episodes rolled out, and recorded with curves in a process beside for each core"
    store_rows(benchmark, Row(what, "episodes/s", rates[0], "episodes rolled out, all cores", rates[1], aim=0.667))


@pytest.mark.parametrize("count", [1, 16, 256])
def test_curves_of_the_success_model(benchmark: BenchmarkFixture, count: int):
    success_model, states = model(), np.random.default_rng(1).normal(size=(count, 48))
    seconds = time_work(benchmark, lambda: success_model.curve(states), 20)
    what = f"Success curves of 51 actions, {count} state{'s'[: count - 1]} at once"
    store_rows(benchmark, Row(what, "calls/s", 1.0 / seconds, "control steps of 20 ms", 50.0))
