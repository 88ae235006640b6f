"""Exports: tables hold every number exactly in a named column, and a failed export leaves no incomplete file."""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest

from dextron_bench import recording
from dextron_bench.recording import export, film
from dextron_bench.recording.export import UnknownSuffix
from dextron_bench.recording.film import FilmStyle
from dextron_bench.world import model
from dextron_bench.world.rendering import renderer
from tests.recording.test_episode_file import PATH, episode


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("recorded") / "episode.rrd"
    played = episode(4)
    played.rewards[-1] = 1.0
    recording.write(file, played, PATH, {})
    return file


def test_every_number_of_a_state_has_a_name():
    physics, names = model.load(), model.state_names()
    assert len(set(names)) == len(names) == model.STATE
    for joint in range(physics.njnt):
        joint_name = physics.joint(joint).name
        free = physics.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        assert names[physics.jnt_qposadr[joint]] == (f"{joint_name}_x" if free else joint_name)
        assert names[25 + physics.jnt_dofadr[joint]] == f"{joint_name}_{'vx' if free else 'velocity'}"
    assert names[model.BOTTLE_QUATERNION] == ("bottle_qw", "bottle_qx", "bottle_qy", "bottle_qz")
    assert names[model.PALM_POSITION] == ("palm_x", "palm_y", "palm_z")
    assert names[25:31] == ("bottle_vx", "bottle_vy", "bottle_vz", "bottle_wx", "bottle_wy", "bottle_wz")


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".CSV"])
def test_a_table_holds_every_step_bit_for_bit(recorded: Path, tmp_path: Path, suffix: str):
    file = tmp_path / "new" / f"episode{suffix}"
    export.export(recorded, file, FilmStyle())
    table = pd.read_parquet(file) if suffix == ".parquet" else pd.read_csv(file, float_precision="round_trip")
    played = recording.read(recorded).episode
    assert list(table.columns) == ["step", "seconds", *model.state_names(), "action", "reward"]
    assert table["step"].tolist() == [0, 1, 2, 3, 4]
    assert table["seconds"].tolist() == [0.0, 0.02, 0.04, 0.06, 0.08]
    np.testing.assert_array_equal(table[list(model.state_names())].to_numpy(), played.states)
    np.testing.assert_array_equal(table["action"], [*played.actions[:, 0], np.nan])
    np.testing.assert_array_equal(table["reward"], [0.0, 0.0, 0.0, 1.0, np.nan])
    assert os.listdir(file.parent) == [file.name]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_the_suffix_decides_the_format_of_a_film(recorded: Path, tmp_path: Path, suffix: str):
    progress, file = [], tmp_path / f"film{suffix}"

    def report(done: int, total: int, note: str = "") -> None:
        progress.append((done, total))

    export.export(recorded, file, FilmStyle(64, 48), report)
    assert progress[-1] == ((5, 5) if suffix == ".mp4" else (3, 3))
    assert file.read_bytes()[:12].startswith(b"GIF89a" if suffix == ".gif" else b"\x00\x00\x00")
    assert os.listdir(tmp_path) == [file.name]


def test_an_unknown_suffix_lists_the_formats_before_anything_is_read(tmp_path: Path):
    for name in ("film.avi", "film"):
        with pytest.raises(
            UnknownSuffix, match=r"film.*: cannot export to .*; choose from \.mp4, \.gif, \.csv, \.parquet"
        ):
            export.export(tmp_path / "none.rrd", tmp_path / name, FilmStyle())


def test_a_failed_export_keeps_the_old_file(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = tmp_path / "film.gif"
    file.write_text("before")

    def fill_disk(part: Path, *_: object) -> None:
        part.write_bytes(b"GIF89a")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(export.FILMS, ".gif", fill_disk)
    with pytest.raises(OSError, match="No space left"):
        export.export(recorded, file, FilmStyle())
    assert (file.read_text(), os.listdir(tmp_path)) == ("before", ["film.gif"])


def test_a_damaged_recording_is_not_exported(recorded: Path, tmp_path: Path):
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(recorded.read_bytes()[:-20])
    with pytest.raises(recording.BrokenRecording, match=r"cut\.rrd: is cut short"):
        export.export(cut, tmp_path / "film.csv", FilmStyle())
    assert os.listdir(tmp_path) == ["cut.rrd"]


@pytest.mark.slow
def test_frames_of_a_film_are_close_to_stills():
    states = episode(1).states
    with renderer.Renderer(32, 24, supersampling=2) as frame_renderer:
        expected = frame_renderer.render(states[0], renderer.CAMERAS["side"])
    np.testing.assert_array_equal(renderer.frames(states, 32, 24)[0], expected)
    coarse = next(iter(film._frames(states, [0], FilmStyle(32, 24))))
    assert np.abs(coarse.astype(int) - expected).mean() < 5.0
