"""`view --live RUN` and `run --tracker`: finished and growing trainings, from the command line."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rerun as rr
from rerun.chunk import RrdReader

from dextron_bench.cli import main
from dextron_bench.tracking import launch, live, packages
from tests.helpers import tiny_training
from tests.helpers.tiny_training import TOY, train
from tests.helpers.tracked_training import FOLDER, killed, trained


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The working folder."""
    monkeypatch.chdir(tmp_path)


def watch(monkeypatch: pytest.MonkeyPatch, file: Path, looks: list[Callable[[], object]]) -> None:
    """Replaces the viewer by a file; between two looks of the viewer, one of `looks` is called. Then it is closed."""
    remaining = iter(looks)

    @contextmanager
    def open_training_viewer() -> Iterator[tuple[Callable[[rr.RecordingStream], None], Callable[[], bool]]]:
        streams: list[rr.RecordingStream] = []

        def connect(stream: rr.RecordingStream) -> None:
            stream.save(file)
            streams.append(stream)

        def is_open() -> bool:
            step = next(remaining, None)
            if step:
                step()
            return step is not None

        yield connect, is_open
        for stream in streams:
            stream.disconnect()

    monkeypatch.setattr(live, "open_training_viewer", open_training_viewer)
    monkeypatch.setattr(live, "POLL", 0.0)


def shown(file: Path, entity: str) -> list[int]:
    """The epochs of an entity."""
    chunks = RrdReader(file).store().stream().to_chunks()
    batches = [chunk.to_record_batch() for chunk in chunks if chunk.entity_path == entity and not chunk.is_static]
    return sorted(epoch for batch in batches for epoch in batch.column("epoch").to_pylist())


def nothing() -> None: ...


def test_a_finished_training_is_shown_whole(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    trained(Path())
    watch(monkeypatch, Path("live.rrd"), [nothing] * 12)
    assert main.main(["view", "--live", "runs/toy-0.1"]) == 0
    assert capsys.readouterr().out == "toy-0.1/synthetic/0+3: 16 points shown\n"
    assert shown(Path("live.rrd"), "/curves/train/loss/seed3") == [1, 2, 3, 4, 5]
    assert shown(Path("live.rrd"), "/curves/val/return/seed0") == [2, 4, 5]


def test_a_growing_training_is_followed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """It begins without a file, is killed in epoch 4, and is cut to epoch 2 when it is resumed."""
    folder = Path(FOLDER)
    folder.mkdir(parents=True)
    looks = [nothing, lambda: killed(folder, 4), *[nothing] * 6, lambda: train(folder), *[nothing] * 8]
    watch(monkeypatch, Path("live.rrd"), looks)
    assert main.main(["view", "--live", FOLDER]) == 0
    assert capsys.readouterr().out == "toy-0.1/synthetic/0+3: 16 points shown\n"
    assert shown(Path("live.rrd"), "/curves/train/loss/seed0") == [1, 2, 3, 4, 5]
    assert shown(Path("live.rrd"), "/curves/val/return/seed3") == [2, 4, 5]


def test_a_place_without_a_training_is_one_line(tmp_path: Path, complaint: Callable[..., str]):
    assert "holds no training; give a folder in which `dextron-bench run` trains" in complaint("view", "--live", "data")


def test_run_starts_trackers_beside_its_training(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]
):
    followed: list[tuple[list[str], list[str]]] = []
    graces: list[float] = []

    @contextmanager
    def following(folders: list[Path], names: list[str], say: Callable[[str], None], grace: float) -> Iterator[None]:
        followed.append(([str(folder) for folder in folders], names))
        graces.append(grace)
        yield
        say("tracker rerun: 16 points")

    monkeypatch.setattr(launch, "following", following)
    words = ["run", "--method", TOY, "--preset", "smoke", "--split", "test", "--record", "0", "--quiet"]
    assert main.main([*words, "--json", "--tracker", "rerun", "--live", "--seed", "0", "3"]) == 0
    assert followed == [(["runs/toy-0.1/synthetic/training-0+3"], ["rerun", "live"])]
    printed = capsys.readouterr()
    assert json.loads(printed.out)[0]["method"] == "toy-0.1"
    assert printed.err == "dextron-bench: tracker rerun: 16 points\n"
    before = tiny_training.contents(Path(FOLDER))
    assert main.main([*words, "--json", "--seed", "0", "3", "--tracker", "rerun"]) == 0  # Shows the finished training.
    assert followed[1] == (["runs/toy-0.1/synthetic/training-0+3"], ["rerun"])
    assert graces == [launch.GRACE, launch.PATIENCE]
    assert tiny_training.contents(Path(FOLDER)) == before
    assert main.main([*words, "--json"]) == 0
    assert len(followed) == 2
    monkeypatch.setattr(packages.importlib.util, "find_spec", lambda name: None)
    assert "--tracker wandb needs the package" in complaint(*words, "--tracker", "wandb")
