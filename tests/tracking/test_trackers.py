"""What each tracker writes, read back with its own library."""

from __future__ import annotations

import importlib
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rerun.chunk import RrdReader

from dextron_bench.errors import MissingPackage
from dextron_bench.tracking import films, packages, trackers
from dextron_bench.tracking.follower import Counts, Follower
from tests.helpers import tracked_training
from tests.helpers.tracked_training import GIF

BLOCK = 32768  # Bytes of a block in a file of W&B.


@pytest.fixture(autouse=True)
def no_rendering(monkeypatch: pytest.MonkeyPatch) -> None:
    """Films of one pixel, because rendering takes seconds."""
    monkeypatch.setattr(films, "gif", lambda episode: GIF)


def write(name: str, base: Path) -> tuple[Path, dict[tuple[int, int], float]]:
    """Follows a finished training; returns the tracker's folder, and the mean returns by epoch and seed."""
    pytest.importorskip(name)
    files, into = tracked_training.trained(base), base / "tracking" / name
    follower = Follower(files, trackers.create(name, files, into))
    follower.run(lambda: True, lambda: False, lambda counts: None)
    assert follower.counts == Counts(16, 6, 0, "", True)
    again = tracked_training.TrainingFiles(files.folder, files.seeds).evaluations()
    return into, {(one.point.epoch, one.point.seed): one.point.values["val/return"] for one in again}


def test_tensorboard_reads_curves_and_films(tmp_path: Path):
    into, returns = write("tensorboard", tmp_path)
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    for seed in (0, 3):
        events = EventAccumulator(str(into / f"seed{seed}"))
        events.Reload()
        curve = {event.step: event.value for event in events.Scalars("val/return")}
        assert curve == pytest.approx({epoch: value for (epoch, k), value in returns.items() if k == seed})
        assert [event.step for event in events.Scalars("train/loss")] == [1, 2, 3, 4, 5]
        images = events.Images("val/episode0")
        assert [image.step for image in images] == [2, 4, 5]
        assert images[0].encoded_image_string == GIF
        assert {"time/steps_per_second", "val/success"} <= set(events.Tags()["scalars"])


def test_wandb_reads_an_offline_run_for_each_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("WANDB_MODE", raising=False)
    into, returns = write("wandb", tmp_path)
    messages: Any = importlib.import_module("wandb.proto.wandb_internal_pb2")

    curves: dict[int, dict[int, float]] = {}
    for file in into.rglob("run-*.wandb"):
        seed = -1
        for data in wandb_records(file.read_bytes()):
            record = messages.Record()
            record.ParseFromString(data)
            if record.WhichOneof("record_type") == "run":
                seed = int(record.run.display_name.rpartition("seed")[2])
            items = {item.key or "/".join(item.nested_key): item.value_json for item in record.history.item}
            if "val/return" in items:
                curves.setdefault(seed, {})[int(items["epoch"])] = float(items["val/return"])
    assert curves == {k: {epoch: value for (epoch, seed), value in returns.items() if seed == k} for k in (0, 3)}
    assert len(list(into.rglob("media/videos/**/*.gif"))) == 6


def wandb_records(content: bytes) -> Iterator[bytes]:
    """The records of a run's file, which has the form of LevelDB's logs; W&B reads it in Go alone."""
    place, record = 7, b""
    while place < len(content):
        if (left := BLOCK - place % BLOCK) < 7:
            place += left
            continue
        _, length, kind = struct.unpack("<IHB", content[place : place + 7])
        record += content[place + 7 : place + 7 + length]
        place += 7 + length
        if kind in (1, 4):  # A whole record, or the last part of one.
            yield record
            record = b""


def test_trackio_reads_a_run_for_each_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    pytest.importorskip("trackio")
    sqlite_storage, utils = (importlib.import_module(f"trackio.{name}") for name in ("sqlite_storage", "utils"))
    monkeypatch.setattr(sqlite_storage, "TRACKIO_DIR", tmp_path / "database")
    monkeypatch.setattr(utils, "TRACKIO_DIR", tmp_path / "database")
    _, returns = write("trackio", tmp_path)
    for seed in (0, 3):
        logs = sqlite_storage.SQLiteStorage.get_logs("dextron-bench", f"toy-0.1 synthetic seed{seed}")
        curve = {row["step"]: row["val/return"] for row in logs if "val/return" in row}
        assert curve == {epoch: value for (epoch, k), value in returns.items() if k == seed}


def test_rerun_reads_curves_and_episodes(tmp_path: Path):
    into, returns = write("rerun", tmp_path)
    chunks = RrdReader(into / "training.rrd").store().stream().to_chunks()
    curve: dict[int, float] = {}
    steps: list[int] = []
    for chunk in chunks:
        if chunk.entity_path == "/curves/val/return/seed3" and not chunk.is_static:
            batch = chunk.to_record_batch()
            epochs, values = batch.column("epoch").to_pylist(), batch.column("Scalars:scalars").to_pylist()
            curve |= {epoch: value[0] for epoch, value in zip(epochs, values, strict=True)}
        if chunk.entity_path == "/seed3/world/palm" and not chunk.is_static:
            steps += chunk.to_record_batch().column("step").to_pylist()
    assert curve == {epoch: value for (epoch, k), value in returns.items() if k == 3}
    assert sorted(steps) == [*range(40, 44), *range(80, 84), *range(100, 104)]  # Four states from frames 40, 80, 100.


def test_a_tracker_without_its_package_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(packages.importlib.util, "find_spec", lambda name: None)
    packages.require(["rerun"])
    with pytest.raises(MissingPackage, match=r"needs the package of this name: `pip install wandb`"):
        packages.require(["rerun", "wandb"])
