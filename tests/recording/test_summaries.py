"""Summaries report the properties of a recording, or its damage in one line."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from dextron_bench import recording
from dextron_bench.processes import limited_process
from dextron_bench.recording import reader_process
from dextron_bench.recording.summaries import NEEDED
from tests.helpers import many_processors
from tests.recording.test_episode_file import PATH, PROPERTIES, SETTING, episode

DEADLY = """
import json, os, sys
def main():
    for line in sys.stdin:
        if "deadly" in line:
            os.abort()
        print(json.dumps({"applications": ["dextron-bench"], "properties": {"episode": %s}}), flush=True)
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An undamaged recording; tests damage copies of it."""
    file = tmp_path_factory.mktemp("whole") / "episode.rrd"
    recording.write(file, episode(20), PATH, PROPERTIES)
    return file


def damages(files: list[Path], whole: bool = False) -> list[str]:
    return [summary.damage for summary in recording.summarise(files, whole)]


def test_a_summary_has_all_properties_with_their_types(whole: Path):
    (summary,) = recording.summarise([whole])
    assert (summary.file, summary.size, summary.damage) == (whole, whole.stat().st_size, "")
    expected = PROPERTIES | {"reach": SETTING.reach, "steps": 20, "episode_return": 0.0, "outcome": "not lifted"}
    expected |= {"terminated": False, "truncated": True, "failure": "", "duration_noise": SETTING.duration_noise}
    expected |= {"offset_x": SETTING.offset_x, "offset_y": SETTING.offset_y}
    assert summary.properties == expected
    types = {name: type(value) for name, value in summary.properties.items()}
    assert types == {name: type(value) for name, value in expected.items()}


def test_each_fault_of_the_format_has_its_message(whole: Path, tmp_path: Path):
    content = whole.read_bytes()
    faults = {
        "empty": (b"", "is empty"),
        "cut": (content[: len(content) // 2], "is cut short"),
        "footless": (content[:-1], "is cut short: it has no footer"),
        "text": (b"reach,return\n" * 9, "is no .rrd file"),
        "short": (b"a,", "is no .rrd file"),
        "older": (b"RRF1" + content[4:], "is an .rrd file of another version of Rerun"),
    }
    for name, (damaged, _) in faults.items():
        (tmp_path / name).write_bytes(damaged)
    (tmp_path / "folder").mkdir()
    names = [*faults, "folder", "none"]
    expected = [message for _, message in faults.values()] + ["is no file", "there is no such file"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reported = damages([tmp_path / name for name in names])
    for name, message, damage in zip(names, expected, reported, strict=True):
        assert damage.startswith(message), name


def test_long_properties_do_not_reach_the_process_that_asks(whole: Path, tmp_path: Path):
    """A file of a megabyte can hold a text that fills the memory."""
    file = tmp_path / "long.rrd"
    recording.write(file, episode(20), PATH, {**PROPERTIES, "note": "x" * 2**16})
    assert damages([file, whole]) == ["cannot be read (its properties have more than 65536 characters)", ""]


def test_other_applications_other_versions_and_damage_have_different_messages(whole: Path, tmp_path: Path):
    other, older, flipped = (tmp_path / name for name in ("other.rrd", "older.rrd", "flipped.rrd"))
    for file, application in ((other, "another"), (older, "dextron-bench")):
        stream = rr.RecordingStream(application, recording_id="a")
        stream.save(file)
        stream.log("a", rr.TextLog("b"))
        stream.disconnect()
    content = bytearray(whole.read_bytes())
    content[-60] ^= 1  # In the footer, which has a checksum.
    flipped.write_bytes(content)
    reported = damages([other, older, flipped, whole])
    assert reported[0] == "is no recording of dextron-bench, but of another"
    assert reported[1] == "is a recording of another version of dextron-bench: it lacks the property 'reach'"
    assert reported[2].startswith("is damaged (")
    assert "flipped.rrd" not in reported[2]
    assert reported[3] == ""


@pytest.mark.slow
def test_a_changed_value_is_noticed_if_all_of_the_file_is_read(whole: Path, tmp_path: Path):
    changed = tmp_path / "changed.rrd"
    content = bytearray(whole.read_bytes())
    content[content.index(recording.read(whole).episode.states[11, 20].tobytes())] ^= 1
    changed.write_bytes(content)
    assert damages([changed, whole]) == ["", ""]
    assert damages([changed, whole], whole=True)[0].startswith("its content does not match its digest")
    with pytest.raises(recording.BrokenRecording, match=r"changed\.rrd: its content does not match"):
        recording.read_safely(changed)
    assert recording.read_safely(whole).episode.setting == SETTING


def test_a_file_that_aborts_its_reader_is_reported_and_the_other_files_are_read(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    script, deadly = tmp_path / "reader.py", tmp_path / "deadly.rrd"
    needed = dict.fromkeys(NEEDED, 0)
    script.write_text(DEADLY % needed)
    shutil.copy(whole, deadly)
    monkeypatch.setattr(reader_process, "__file__", str(script))
    reported = damages([deadly, whole, deadly, deadly, whole, deadly])
    message = "cannot be read (the process that read it ended with code "
    assert [damage[: len(message)] for damage in reported] == [message * bad for bad in (1, 0, 1, 1, 0, 1)]
    with pytest.raises(
        recording.BrokenRecording, match=r"deadly\.rrd: cannot be read \(the process that read it ended"
    ):
        recording.read_safely(deadly)


def test_one_process_screens_several_files(whole: Path, monkeypatch: pytest.MonkeyPatch):
    commands, run = [], limited_process.run

    def counted(*command: Any) -> limited_process.Outcome:
        commands.append(command)
        return run(*command)

    monkeypatch.setattr(limited_process, "run", counted)
    cut = whole.with_name("cut.rrd")
    cut.write_bytes(whole.read_bytes()[:999])
    first, second, third = recording.screen([whole, cut, whole])
    assert len(commands) == 1
    for summary in (first, third):
        assert np.array_equal(recording.read_screened(summary).episode.states, recording.read(whole).episode.states)
    with pytest.raises(recording.BrokenRecording, match=r"cut\.rrd: is cut short"):
        recording.read_screened(second)


def test_a_reader_that_does_not_start_is_an_error(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    script = tmp_path / "reader.py"
    script.write_text("raise SystemExit('no rerun here')")
    monkeypatch.setattr(reader_process, "__file__", str(script))
    with pytest.raises(
        recording.ReaderError,
        match="recordings cannot be read: the process that reads files cannot start: no rerun here",
    ):
        damages([whole])


def test_no_files_start_no_reader(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(reader_process, "__file__", "nowhere")
    assert damages([]) == []


@pytest.mark.slow
@pytest.mark.parametrize("count", [64, 128])
def test_recordings_are_read_on_a_machine_with_many_processors(whole: Path, tmp_path: Path, count: int):
    """Rerun starts a thread for each processor, and reserves 70 MB for each thread."""
    command = [sys.executable, "-m", "dextron_bench", "recordings", "list", str(whole), "--check", "--json"]
    environment = many_processors.environment(tmp_path, count)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_a_recording_without_a_footer_of_a_version_that_writes_none_is_read(whole: Path, tmp_path: Path):
    """Rerun 0.26 ends a file with no footer."""
    file, content = tmp_path / "older.rrd", whole.read_bytes()
    end = 12
    while (header := struct.unpack_from("<QQ", content, end))[0]:  # Kind and length [bytes] of a message; 0 is the end.
        end += 16 + header[1]
    file.write_bytes(content[:4] + b"\0\x1a\2" + content[7:end] + b"\0" * 16)
    assert damages([file]) == damages([file], whole=True) == [""]
    assert np.array_equal(recording.read_safely(file).episode.states, recording.read(whole).episode.states)
