"""Recordings hold exact arrays, are written atomically, and their damage is noticed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rerun.chunk import Chunk, RrdReader

from dextron_bench import recording
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.reaches import reach
from dextron_bench.reaches.setting import Setting
from dextron_bench.recording import blueprint, episode_file, rrd_file, scene
from dextron_bench.world import model

PROPERTIES: dict[str, recording.Value] = {
    "method": "bc",
    "seed": 3,
    "share": 0.1,
    "quick": False,
    "note": "",
    "big": 2**62,
}
SETTING = Setting("05_fr_05", 0.01, -0.02, 1 / 3)
PATH = reach.Trajectory(np.zeros((5, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (5, 1)))


def episode(steps: int, seed: int = 0, **ends: Any) -> Episode:
    """An episode of random numbers around the first state, with the right shapes."""
    rng = np.random.default_rng(seed)
    first = np.concatenate([model.initial_qpos(), np.zeros(23)])
    states = first + rng.normal(0.0, 0.01, (steps + 1, model.STATE))
    ending = {"terminated": False, "truncated": True, **ends}
    return Episode(SETTING, states, rng.uniform(-1, 1, (steps, 1)), np.zeros(steps), **ending)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "episode.rrd"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An undamaged recording; tests damage copies of it."""
    file = tmp_path_factory.mktemp("whole") / "episode.rrd"
    recording.write(file, episode(20), PATH, PROPERTIES)
    return file


def test_arrays_come_back_bit_for_bit(file: Path) -> None:
    played = episode(7)
    played.actions[:4, 0] = [np.nan, -0.0, np.inf, 5e-324]
    played.rewards[:2] = [-np.inf, 0.1 + 0.2]
    played.states[3, 30:33] = [-0.0, np.nan, np.inf]
    recording.write(file, played, PATH, PROPERTIES)
    read = recording.read(file)
    for name in ("states", "actions", "rewards"):
        written, array = getattr(played, name), getattr(read.episode, name)
        assert written.tobytes() == array.tobytes()
        assert (written.shape, written.dtype) == (array.shape, array.dtype)
    assert read.episode.setting == SETTING
    assert (read.episode.terminated, read.episode.truncated, read.episode.failure) == (False, True, "")


def test_properties_come_back_with_their_types(whole: Path) -> None:
    properties = recording.read(whole).properties
    assert properties == PROPERTIES
    assert {name: type(value) for name, value in properties.items()} == {n: type(v) for n, v in PROPERTIES.items()}


def test_a_failed_agent_keeps_its_reason_and_scores_nothing(file: Path) -> None:
    played = episode(3, truncated=False, failure="action is nan at step 3")
    recording.write(file, played, PATH, {})
    read = recording.read(file)
    assert read.episode.failure == "action is nan at step 3"
    assert read.properties == {}


def test_equal_episodes_have_equal_digests_in_unequal_files(tmp_path: Path) -> None:
    def digest(name: str, seed: int) -> str:
        recording.write(tmp_path / name, episode(4, seed), PATH, PROPERTIES)
        return RrdReader(tmp_path / name).recordings()[0].recording_id

    assert digest("a.rrd", 0) == digest("b.rrd", 0) != digest("c.rrd", 1)


def test_write_returns_the_sha256_of_the_file(file: Path) -> None:
    sha256 = recording.write(file, episode(2), PATH, {})
    assert recording.read(file, sha256).episode.setting == SETTING
    with pytest.raises(recording.BrokenRecording, match="SHA-256"):
        recording.read(file, "0" * 64)


def test_one_flipped_byte_of_the_states_is_noticed(whole: Path, file: Path) -> None:
    content = bytearray(whole.read_bytes())
    position = content.index(recording.read(whole).episode.states[11, 20].tobytes())
    content[position] ^= 1
    file.write_bytes(content)
    with pytest.raises(recording.BrokenRecording, match=r"episode\.rrd: its content does not match its digest"):
        recording.read(file)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.0, 1.0, exclude_max=True))
def test_a_recording_cut_anywhere_is_noticed(whole: Path, file: Path, share: float) -> None:
    content = whole.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    with pytest.raises(recording.BrokenRecording, match=r"is empty|is no \.rrd file|is cut short"):
        recording.read(file)


def test_errors_name_a_missing_file_and_a_file_of_another_format(file: Path) -> None:
    with pytest.raises(recording.BrokenRecording, match="there is no such file"):
        recording.read(file)
    file.write_text("reach,return\n")
    with pytest.raises(recording.BrokenRecording, match=r"no \.rrd file"):
        recording.read(file)


def test_a_file_of_another_application_is_refused(file: Path) -> None:
    rrd_file.save(file, blueprint.line_styles(), "other", blueprint.blueprint())
    with pytest.raises(recording.BrokenRecording, match="no digest"):
        recording.read(file)


def chunks_of(file: Path) -> list[Chunk]:
    return RrdReader(file).store().stream().to_chunks()


def forge(file: Path, chunks: list[Chunk]) -> None:
    """Writes chunks with their correct digest."""
    identity = episode_file.digest(episode_file.lines(chunks))
    digest = Chunk.from_property("digest", rr.AnyValues(sha256=identity))
    rrd_file.save(file, [*chunks, digest], identity, blueprint.blueprint())


def test_states_of_uneven_length_are_refused(whole: Path, file: Path) -> None:
    omitted = ("/__properties/digest", "/episode/states")
    kept = [chunk for chunk in chunks_of(whole) if chunk.entity_path not in omitted]
    uneven = rr.Scalars.columns(scalars=np.zeros(7)).partition([3, 4])
    forge(file, [*kept, Chunk.from_columns("/episode/states", scene.timelines(0, 1), uneven)])
    with pytest.raises(recording.BrokenRecording, match="holds arrays that do not form an episode"):
        recording.read(file)


def test_a_recording_without_a_property_is_of_another_version(whole: Path, file: Path) -> None:
    """Its digest is correct, so it is not damaged."""
    forge(file, [chunk for chunk in chunks_of(whole) if not chunk.entity_path.startswith("/__properties")])
    with pytest.raises(recording.BrokenRecording, match="of another version of dextron-bench: it lacks 'reach'"):
        recording.read(file)


@pytest.mark.parametrize("broken", ["states", "actions", "rewards"])
def test_arrays_of_the_wrong_type_are_refused(file: Path, broken: str) -> None:
    arrays = {name: getattr(episode(3), name) for name in ("states", "actions", "rewards")}
    arrays[broken] = arrays[broken].astype(np.float32)
    with pytest.raises(ValueError, match=f"{broken} of 3 steps must be float64"):
        recording.write(file, Episode(SETTING, **arrays, terminated=False, truncated=True), PATH, {})


def test_a_recording_of_150_steps_stays_under_650_kb(file: Path) -> None:
    recording.write(file, episode(150), PATH, PROPERTIES)
    assert file.stat().st_size < 650_000
