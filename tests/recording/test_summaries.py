"""What recordings say of themselves: told quickly, and whatever is wrong with a file, in one line that names it."""

from __future__ import annotations

import shutil
import subprocess
import warnings
from pathlib import Path

import numpy as np
import pytest
import rerun as rr

from dextron_bench import recording
from dextron_bench.recording import reader_process
from dextron_bench.recording.summaries import NEEDED
from tests.recording.test_episode_file import PATH, PROPERTIES, SETTING, episode

DEADLY = """
import json, os, sys
print("null", flush=True)
for line in sys.stdin:
    if "deadly" in line:
        os.abort()
    print(json.dumps({"applications": ["dextron-bench"], "properties": {"episode": %s}}), flush=True)
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording to be damaged in copies."""
    file = tmp_path_factory.mktemp("whole") / "episode.rrd"
    recording.write(file, episode(20), PATH, PROPERTIES)
    return file


def damages(files: list[Path], whole: bool = False) -> list[str]:
    return [summary.damage for summary in recording.summarise(files, whole)]


def test_all_properties_come_with_their_types(whole: Path):
    (found,) = recording.summarise([whole])
    assert (found.file, found.size, found.damage) == (whole, whole.stat().st_size, "")
    told = PROPERTIES | {"reach": SETTING.reach, "steps": 20, "episode_return": 0.0, "outcome": "not lifted"}
    told |= {"terminated": False, "truncated": True, "failure": "", "duration_noise": SETTING.duration_noise}
    told |= {"offset_x": SETTING.offset_x, "offset_y": SETTING.offset_y}
    assert found.properties == told
    assert {name: type(value) for name, value in told.items()} == {n: type(v) for n, v in found.properties.items()}


def test_what_a_files_form_tells_is_told_apart(whole: Path, tmp_path: Path):
    content = whole.read_bytes()
    forms = {
        "empty": (b"", "is empty"),
        "cut": (content[: len(content) // 2], "is cut short"),
        "footless": (content[:-1], "is cut short, or its writing was: it has no footer"),
        "text": (b"reach,return\n" * 9, "is no .rrd file"),
        "short": (b"a,", "is no .rrd file"),
        "older": (b"RRF1" + content[4:], "is an .rrd file of another version of Rerun"),
    }
    for name, (damaged, _) in forms.items():
        (tmp_path / name).write_bytes(damaged)
    (tmp_path / "folder").mkdir()
    names = [*forms, "folder", "none"]
    expected = [told for _, told in forms.values()] + ["is no file", "there is no such file"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = damages([tmp_path / name for name in names])
    for name, told, told_of in zip(names, expected, found, strict=True):
        assert told_of.startswith(told), name


def test_a_recording_of_something_else_is_told_from_a_damaged_one(whole: Path, tmp_path: Path):
    other, older, flipped = (tmp_path / name for name in ("other.rrd", "older.rrd", "flipped.rrd"))
    for file, application in ((other, "another"), (older, "dextron-bench")):
        stream = rr.RecordingStream(application, recording_id="a")
        stream.save(file)
        stream.log("a", rr.TextLog("b"))
        stream.disconnect()
    content = bytearray(whole.read_bytes())
    content[-60] ^= 1  # In the footer, whose checksum Rerun knows.
    flipped.write_bytes(content)
    found = damages([other, older, flipped, whole])
    assert found[0] == "is no recording of dextron-bench, but of another"
    assert found[1] == "is a recording of another version of dextron-bench: it does not tell its reach"
    assert found[2].startswith("is damaged (")
    assert "flipped.rrd" not in found[2]
    assert found[3] == ""


def test_a_value_that_changed_is_noticed_where_all_is_read(whole: Path, tmp_path: Path):
    changed = tmp_path / "changed.rrd"
    content = bytearray(whole.read_bytes())
    content[content.index(recording.read(whole).episode.states[11, 20].tobytes())] ^= 1
    changed.write_bytes(content)
    assert damages([changed, whole]) == ["", ""]
    assert damages([changed, whole], whole=True)[0].startswith("its content does not match its digest")
    with pytest.raises(recording.BrokenRecording, match=r"changed\.rrd: its content does not match"):
        recording.read_safely(changed)
    assert recording.read_safely(whole).episode.setting == SETTING


def test_a_file_that_ends_the_process_that_reads_it_is_named_and_the_rest_is_read(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    script, deadly = tmp_path / "glance.py", tmp_path / "deadly.rrd"
    needed = dict.fromkeys(NEEDED, 0)
    script.write_text(DEADLY % needed)
    shutil.copy(whole, deadly)
    monkeypatch.setattr(reader_process, "__file__", str(script))
    found = damages([deadly, whole, deadly, deadly, whole, deadly])
    assert [told[:44] for told in found] == [
        "is damaged (reading it ended the process tha" * bad for bad in (1, 0, 1, 1, 0, 1)
    ]
    with pytest.raises(recording.BrokenRecording, match=r"deadly\.rrd: is damaged \(reading it ended"):
        recording.read_safely(deadly)


def test_files_of_unknown_origin_are_screened_by_one_process(whole: Path, monkeypatch: pytest.MonkeyPatch):
    started, run = [], subprocess.run
    monkeypatch.setattr(subprocess, "run", lambda command, **told: started.append(command) or run(command, **told))
    cut = whole.with_name("cut.rrd")
    cut.write_bytes(whole.read_bytes()[:999])
    first, second, third = recording.screen([whole, cut, whole])
    assert len(started) == 1
    for summary in (first, third):
        assert np.array_equal(recording.read_screened(summary).episode.states, recording.read(whole).episode.states)
    with pytest.raises(recording.BrokenRecording, match=r"cut\.rrd: is cut short"):
        recording.read_screened(second)


def test_a_reader_that_does_not_start_is_no_damage(whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    script = tmp_path / "glance.py"
    script.write_text("raise SystemExit('no rerun here')")
    monkeypatch.setattr(reader_process, "__file__", str(script))
    with pytest.raises(recording.ReaderError, match="recordings cannot be read: no rerun here"):
        damages([whole])


def test_nothing_is_no_work(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(reader_process, "__file__", "nowhere")
    assert damages([]) == []
