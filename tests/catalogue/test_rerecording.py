"""Recordings made afterwards equal recordings made during the run; a differing episode is never recorded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from rerun.chunk import RrdReader

from dextron_bench.catalogue import episodes, rerecording, selection
from dextron_bench.catalogue.rerecording import Unplayable
from dextron_bench.catalogue.selection import EpisodeFilter
from dextron_bench.runs import execution, run_files
from dextron_bench.runs.plans import Plan, resolve
from dextron_bench.storage import atomic
from dextron_bench.storage.run_folder import RunFolder

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


def play(folder: Path, record: int = 0, method: str = "exp") -> Path:
    return execution.execute(
        resolve(Plan(method, "synthetic", ("val", "test"), seed=2, record=record)), folder, threads=1
    )


def rerecorded(folder: Path, episode_filter: EpisodeFilter = ALL) -> list[Path]:
    return rerecording.rerecord(selection.select(episodes.read([folder]), episode_filter)[0])


def digests(files: list[Path]) -> dict[str, str]:
    """The digest of the content of each recording; it does not depend on row ids."""
    return {file.name: RrdReader(file).recordings()[0].recording_id for file in files}


def change(folder: Path, **values: Any) -> None:
    table = pd.read_parquet(folder / "episodes.parquet")
    run_files.store_episodes(RunFolder(folder), table.assign(**values))


@pytest.mark.slow
def test_recordings_made_afterwards_equal_those_of_the_run(tmp_path: Path):
    during, later = play(tmp_path / "during", record=2), play(tmp_path / "later")
    assert not (later / "recordings").exists()
    files = rerecorded(later)
    expected = sorted((during / "recordings").iterdir())
    assert [file.name for file in files] == ["val-0000.rrd", "test-0000.rrd", "test-0001.rrd"]
    assert digests(files) == digests(expected)


@pytest.mark.slow
def test_existing_recordings_are_not_made_again(tmp_path: Path):
    folder, reports = play(tmp_path, record=1), []
    before = {file.name: file.read_bytes() for file in (folder / "recordings").iterdir()}
    rerecording.rerecord(
        selection.select(episodes.read([folder]), ALL)[0],
        lambda done, total, note="": reports.append((done, total)),
    )
    assert reports == [(1, 1)]
    assert {name: (folder / "recordings" / name).read_bytes() for name in before} == before


@pytest.mark.slow
@pytest.mark.parametrize("damage", [lambda content: content[:-9], lambda content: b"reach,return\n"])
def test_a_damaged_recording_is_replaced(tmp_path: Path, damage: Any):
    folder = play(tmp_path, record=2)
    file = folder / "recordings" / "test-0001.rrd"
    expected = digests([file])
    file.write_bytes(damage(file.read_bytes()))
    assert digests(rerecorded(folder, EpisodeFilter(split=("test",), row=(1,)))) == expected


@pytest.mark.slow
def test_a_recording_of_another_version_of_the_split_is_replaced(tmp_path: Path):
    folder = play(tmp_path, record=1)
    file = folder / "recordings" / "test-0000.rrd"
    expected = digests([file])
    (folder / "recordings" / "val-0000.rrd").replace(file)  # It has the same return.
    assert digests(rerecorded(folder, EpisodeFilter(split=("test",), row=(0,)))) == expected


def test_the_reason_of_a_failed_agent_is_kept(tmp_path: Path):
    (tmp_path / "late.py").write_text(LATE)
    folder = play(tmp_path, method=f"{tmp_path / 'late.py'}:Late")
    table = episodes.read([folder])
    assert set(table["failure"]) == {"action 2.0 is outside [-1, 1] at step 7"}
    (summary,) = rerecording.recording.summarise(rerecorded(folder, EpisodeFilter(split=("val",))))
    assert summary.properties["failure"] == "action 2.0 is outside [-1, 1] at step 7"
    assert (summary.properties["method"], summary.properties["seed"]) == ("late", 2)


@pytest.mark.slow
def test_without_actions_only_existing_recordings_are_available(tmp_path: Path):
    folder = play(tmp_path, record=1)
    table = pd.read_parquet(folder / "episodes.parquet")
    run_files.store_episodes(RunFolder(folder), table.drop(columns="actions"))
    assert len(rerecorded(folder, EpisodeFilter(row=(0,)))) == 2
    with pytest.raises(Unplayable) as caught:
        rerecorded(folder)
    assert str(caught.value).startswith(
        f"test row 1 of {folder} has no recording, and its actions were not kept; remove"
    )
    (folder / "recordings" / "test-0000.rrd").write_bytes(b"")
    with pytest.raises(Unplayable, match="has a recording that is empty, and its actions were not kept"):
        rerecorded(folder, EpisodeFilter(row=(0,)))
    (folder / "episodes.parquet").unlink()  # As the message advises.
    assert len(rerecorded(play(tmp_path))) == 3


@pytest.mark.slow
@pytest.mark.parametrize(("column", "value"), [("score", 19.0), ("length", 3), ("duration_noise", 2.0)])
def test_an_episode_that_differs_when_replayed_is_not_recorded(tmp_path: Path, column: str, value: float):
    folder = play(tmp_path)
    change(folder, **{column: value})
    with pytest.raises(
        Unplayable,
        match=r"test row 0 of .* (differs when it is played again: return .* not |is no setting of this split)",
    ):
        rerecorded(folder, EpisodeFilter(split=("test",), row=(0,)))
    assert not (folder / "recordings").exists()


def test_other_physics_and_an_older_split_are_refused(tmp_path: Path):
    folder = play(tmp_path)
    change(folder, digest="0" * 64)
    with pytest.raises(Unplayable, match="is of an older version of the split"):
        rerecorded(folder)
    config = folder / "config.json"
    config.write_text(json.dumps(json.loads(config.read_text()) | {"physics": "other"}))
    with pytest.raises(Unplayable, match="was played with other physics than this version's; remove"):
        rerecorded(folder)


def test_the_folder_names_an_unfinished_run(tmp_path: Path):
    folder = play(tmp_path)
    assert episodes.run_identity(RunFolder(folder)) == {"method": "exp", "reaches": "synthetic", "seed": 2}
    (folder / "result.json").unlink()
    assert episodes.run_identity(RunFolder(folder)) == {"method": "exp", "reaches": "synthetic", "seed": 2}
    (folder / "config.json").write_text("{}")
    with pytest.raises(atomic.DamagedFile, match="it lacks 'reaches'"):
        episodes.run_identity(RunFolder(folder))
