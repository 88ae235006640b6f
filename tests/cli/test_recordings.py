"""`dextron-bench recordings`: the list, damaged recordings, and exports."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from dextron_bench.cli import main

FOLDER = "runs/exp/synthetic/seed0/recordings"


@pytest.fixture
def here(two_runs: Path) -> Path:
    """A working folder in the tiny world with a run of two recorded episodes."""
    shutil.rmtree(two_runs / "runs/nothing")
    return two_runs


@pytest.mark.slow
def test_recordings_are_listed_with_their_properties(here: Path, capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()
    assert main.main(["recordings", "list"]) == 0
    printed = capsys.readouterr()
    assert [title in printed.out for title in ("file", "outcome", "kB", "success", "20.000")] == [True] * 5
    assert [f"{FOLDER}/test-000{row}.rrd" in printed.out for row in (0, 1)] == [True] * 2  # Not folded.
    assert printed.err == ""
    assert main.main(["recordings", "list", f"{FOLDER}/test-0001.rrd", "--json", "--check"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    steps = int(pd.read_parquet(Path(FOLDER).parent / "episodes.parquet")["length"][1])
    assert row == {
        "file": f"{FOLDER}/test-0001.rrd", "method": "exp", "reaches": "synthetic", "seed": 0, "split": "test",
        "row": 1, "return": 20.0, "outcome": "success", "steps": steps, "cause": "solved",
        "kB": round(Path(f"{FOLDER}/test-0001.rrd").stat().st_size / 1000), "damage": "",
    }  # fmt: skip


@pytest.mark.slow
def test_recordings_are_selected_in_the_words_of_view(
    here: Path, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]
):
    nothing = ["run", "--method", "nothing", "--split", "test", "--quiet", "--json", "--record", "2"]
    assert main.main(nothing) == 0

    def listed(*words: str) -> list[tuple[str, int, str]]:
        capsys.readouterr()
        assert main.main(["recordings", "list", "--json", *words]) == 0
        return [(one["method"], one["row"], one["cause"]) for one in json.loads(capsys.readouterr().out)]

    episodes = [*listed("--method", "exp"), *listed("--failed")]
    assert [episode[:2] for episode in episodes] == [("exp", 0), ("exp", 1), ("nothing", 0), ("nothing", 1)]
    assert listed() == episodes
    assert listed("--cause", "solved", "--row", "1") == [("exp", 1, "solved")]
    assert listed("--where", "success and row == 1") == [("exp", 1, "solved")]
    assert listed("--worst", "1") == episodes[2:3]
    assert listed("--best", "1") == episodes[:1]
    shutil.copytree("runs/nothing/synthetic/seed0/recordings", "elsewhere")
    assert listed("elsewhere") == episodes[2:]  # Without the table of the run.
    assert "no episode has method 'bc'; choose from exp, nothing" in complaint("recordings", "list", "--method", "bc")


def test_damaged_recordings_are_a_line_each_and_code_1(here: Path, capsys: pytest.CaptureFixture[str]):
    whole, cut, text = (Path(FOLDER) / name for name in ("test-0000.rrd", "test-0001.rrd", "text.rrd"))
    cut.write_bytes(cut.read_bytes()[:-30])
    text.write_text("reach,return\n")
    capsys.readouterr()
    assert main.main(["recordings", "list"]) == 1
    printed = capsys.readouterr()
    assert printed.err.splitlines() == [
        f"dextron-bench: {cut}: is cut short: it has no footer",
        f"dextron-bench: {text}: is no .rrd file",
    ]
    assert str(whole) in printed.out
    assert str(cut) not in printed.out
    assert main.main(["recordings", "list", "--json"]) == 1
    rows = json.loads(capsys.readouterr().out)
    assert [bool(row["damage"]) for row in rows] == [False, True, True]
    assert [row["return"] for row in rows] == [20.0, None, None]
    assert main.main(["recordings", "list", str(text)]) == 1
    assert capsys.readouterr().out == ""


def test_check_compares_files_with_the_manifest_of_their_run(here: Path, capsys: pytest.CaptureFixture[str]):
    """No digest covers row ids, but the SHA-256 in the manifest of the run does."""
    file = Path(FOLDER) / "test-0000.rrd"
    content = bytearray(file.read_bytes())
    chunk = RrdReader(file).store().stream().filter(content="/episode/rewards").to_chunks()[0]
    row_ids = chunk.to_record_batch().column("rerun.controls.RowId")
    content[content.index(row_ids[0].as_py())] ^= 1
    file.write_bytes(content)
    assert main.main(["recordings", "list"]) == 0
    capsys.readouterr()
    assert main.main(["recordings", "list", "--check"]) == 1
    assert f"{file}: does not have the SHA-256 that was stored for it" in capsys.readouterr().err


@pytest.mark.slow
def test_a_recording_is_exported_as_a_film_and_a_table(here: Path, capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()
    words = ["recordings", "export", f"{FOLDER}/test-0000.rrd", "--quiet", "--into"]
    assert main.main([*words, "out/grasp.gif", "--width", "32", "--height", "24", "--speed", "20"]) == 0
    assert capsys.readouterr() == ("out/grasp.gif\n", "")
    assert Image.open("out/grasp.gif").size == (32, 24)
    assert main.main([*words, "grasp.csv"]) == 0
    assert pd.read_csv("grasp.csv")["reward"].sum() == 20.0


@pytest.mark.slow
def test_an_impossible_export_is_one_line(here: Path, complaint: Callable[..., str], monkeypatch: pytest.MonkeyPatch):
    words = ["recordings", "export", f"{FOLDER}/test-0000.rrd", "--quiet", "--into"]
    assert "choose from .mp4, .gif, .csv, .parquet" in complaint(*words, "grasp.avi")
    assert "no camera 'left'; choose from" in complaint(*words, "grasp.gif", "--camera", "left")
    assert "choose an even number of pixels" in complaint(*words, "grasp.gif", "--width", "33")
    assert "there is no such file" in complaint("recordings", "export", "none.rrd", "--into", "grasp.csv")
    assert "no recordings at data" in complaint("recordings", "list", "data")
    (here / "taken").write_text("")
    assert "taken" in complaint(*words, "taken/grasp.csv")
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    assert "cannot draw off screen" in complaint(*words, "grasp.mp4")
    assert not list(here.glob("*grasp*"))
