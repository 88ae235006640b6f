"""Recordings after the fact: the same as those made at once, and never of an episode that went otherwise."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from rerun.chunk import RrdReader

from dextron_bench.runs import execution, rerecording, run_files, selection
from dextron_bench.runs.plans import Plan, resolve
from dextron_bench.runs.rerecording import Unplayable
from dextron_bench.runs.selection import EpisodeFilter
from dextron_bench.storage import atomic
from dextron_bench.storage.run_folder import RunFolder
from tests.helpers import tiny_benchmark

ALL = EpisodeFilter(worst=9)
LATE = """
import numpy as np

class Late:
    name = "late"
    def agent(self, seed): return self
    def reset(self, episodes): self.step = 0
    def act(self, states):
        self.step += 1
        return np.full((len(states), 1), 0.5 if self.step <= 7 else 2.0)
"""


@pytest.fixture(autouse=True)
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Tiny splits of short reaches."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path / "data"), monkeypatch.setattr)
    yield
    tiny_benchmark.forget()


def play(folder: Path, record: int = 0, method: str = "exp") -> Path:
    return execution.execute(
        resolve(Plan(method, "synthetic", ("val", "test"), seed=2, record=record)), folder, threads=1
    )


def restored(folder: Path, wish: EpisodeFilter = ALL) -> list[Path]:
    return rerecording.rerecord(selection.select(selection.episodes([folder]), wish)[0])


def digests(files: list[Path]) -> dict[str, str]:
    """What is recorded, whatever the bytes."""
    return {file.name: RrdReader(file).recordings()[0].recording_id for file in files}


def change(folder: Path, **values: Any) -> None:
    table = pd.read_parquet(folder / "episodes.parquet")
    run_files.store_episodes(RunFolder(folder), table.assign(**values))


def test_recordings_made_later_are_those_made_at_once(tmp_path: Path):
    at_once, later = play(tmp_path / "at_once", record=2), play(tmp_path / "later")
    assert not (later / "recordings").exists()
    files = restored(later)
    expected = sorted((at_once / "recordings").iterdir())
    assert [file.name for file in files] == ["val-0000.rrd", "test-0000.rrd", "test-0001.rrd"]
    assert digests(files) == digests(expected)


def test_what_is_recorded_is_not_made_again(tmp_path: Path):
    folder, told = play(tmp_path, record=1), []
    before = {file.name: file.read_bytes() for file in (folder / "recordings").iterdir()}
    rerecording.rerecord(
        selection.select(selection.episodes([folder]), ALL)[0], lambda done, total, note="": told.append((done, total))
    )
    assert told == [(1, 1)]
    assert {name: (folder / "recordings" / name).read_bytes() for name in before} == before


@pytest.mark.parametrize("damage", [lambda content: content[:-9], lambda content: b"reach,return\n"])
def test_a_damaged_recording_is_made_anew(tmp_path: Path, damage: Any):
    folder = play(tmp_path, record=2)
    file = folder / "recordings" / "test-0001.rrd"
    expected = digests([file])
    file.write_bytes(damage(file.read_bytes()))
    assert digests(restored(folder, EpisodeFilter(split=("test",), row=(1,)))) == expected


def test_a_recording_of_another_version_of_the_split_is_made_anew(tmp_path: Path):
    folder = play(tmp_path, record=1)
    file = folder / "recordings" / "test-0000.rrd"
    expected = digests([file])
    (folder / "recordings" / "val-0000.rrd").replace(file)  # Of the same return.
    assert digests(restored(folder, EpisodeFilter(split=("test",), row=(0,)))) == expected


def test_a_failed_agent_keeps_its_own_reason(tmp_path: Path):
    (tmp_path / "late.py").write_text(LATE)
    folder = play(tmp_path, method=f"{tmp_path / 'late.py'}:Late")
    table = selection.episodes([folder])
    assert set(table["failure"]) == {"action 2 is outside [-1, 1] at step 7"}
    (summary,) = rerecording.recording.summarise(restored(folder, EpisodeFilter(split=("val",))))
    assert summary.properties["failure"] == "action 2 is outside [-1, 1] at step 7"
    assert (summary.properties["method"], summary.properties["seed"]) == ("late", 2)


def test_without_actions_only_what_is_recorded_is_there(tmp_path: Path):
    folder = play(tmp_path, record=1)
    table = pd.read_parquet(folder / "episodes.parquet")
    run_files.store_episodes(RunFolder(folder), table.drop(columns="actions"))
    assert len(restored(folder, EpisodeFilter(row=(0,)))) == 2
    with pytest.raises(Unplayable) as caught:
        restored(folder)
    assert str(caught.value).startswith(
        f"test row 1 of {folder} has no recording, and its actions were not kept; remove"
    )
    (folder / "recordings" / "test-0000.rrd").write_bytes(b"")
    with pytest.raises(Unplayable, match="has a recording that is empty, and its actions were not kept"):
        restored(folder, EpisodeFilter(row=(0,)))
    (folder / "episodes.parquet").unlink()  # As the line said.
    assert len(restored(play(tmp_path))) == 3


@pytest.mark.parametrize(("column", "value"), [("score", 19.0), ("length", 3), ("duration_noise", 2.0)])
def test_an_episode_that_goes_otherwise_is_not_recorded(tmp_path: Path, column: str, value: float):
    folder = play(tmp_path)
    change(folder, **{column: value})
    with pytest.raises(Unplayable, match=r"test row 0 of .* differs when it is played again: return .* not "):
        restored(folder, EpisodeFilter(split=("test",), row=(0,)))
    assert not (folder / "recordings").exists()


def test_other_physics_and_another_version_of_the_split_are_told(tmp_path: Path):
    folder = play(tmp_path)
    change(folder, digest="0" * 64)
    with pytest.raises(Unplayable, match="is of an older version of the split"):
        restored(folder)
    config = folder / "config.json"
    config.write_text(json.dumps(json.loads(config.read_text()) | {"physics": "other"}))
    with pytest.raises(Unplayable, match="was played with other physics than this version's; remove"):
        restored(folder)


def test_a_run_under_way_is_called_after_its_folder(tmp_path: Path):
    folder = play(tmp_path)
    assert selection.run_identity(RunFolder(folder)) == {"method": "exp", "reaches": "synthetic", "seed": 2}
    (folder / "result.json").unlink()
    assert selection.run_identity(RunFolder(folder)) == {"method": "exp", "reaches": "synthetic", "seed": 2}
    (folder / "config.json").write_text("{}")
    with pytest.raises(atomic.DamagedFile, match="it lacks 'reaches'"):
        selection.run_identity(RunFolder(folder))
