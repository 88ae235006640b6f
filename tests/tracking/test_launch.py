"""A tracker that is slow, fails or never starts: the training ends with the same bytes; a line says what is lost."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import pytest

from dextron_bench.tracking import launch
from tests.helpers import tiny_training
from tests.helpers.tiny_training import train
from tests.helpers.tracked_training import FOLDER, killed

SLOW = "import time; time.sleep(1000)"  # It notices neither the end of the training nor anything else.
FAILS = "import sys; sys.exit(3)"
COUNTS = {"points": 7, "evaluations": 1, "dropped": 2, "error": "OSError: no connection", "over": True}
WRITES = f"""
import pathlib, sys
sys.stdin.read()
pathlib.Path(sys.argv[3] + ".json").write_text({json.dumps(COUNTS)!r})
"""


def tracked(base: Path, program: str, monkeypatch: pytest.MonkeyPatch, grace: float = 0.5) -> tuple[Path, list[str]]:
    """Trains while a program follows as a tracker; returns the folder and the lines for the user."""
    monkeypatch.setattr(launch, "COMMAND", (sys.executable, "-c", program))
    monkeypatch.setattr(launch, "MARGIN", 0.5)
    lines: list[str] = []
    with launch.following([base / FOLDER], ["wandb"], lines.append, grace):
        train(base / FOLDER)
    return base / FOLDER, lines


@pytest.fixture
def untracked(tmp_path: Path) -> dict[str, bytes]:
    """The files of a training that nothing follows."""
    train(tmp_path / "plain" / FOLDER)
    return tiny_training.contents(tmp_path / "plain" / FOLDER)


def test_a_tracker_that_hangs_is_stopped_and_changes_no_byte(
    tmp_path: Path, untracked: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
):
    start = time.monotonic()
    folder, (line,) = tracked(tmp_path, SLOW, monkeypatch)
    assert time.monotonic() - start < 60.0
    assert tiny_training.contents(folder) == untracked
    assert line.startswith("tracker wandb: 0 points and 0 evaluations with episodes in ")
    assert line.endswith("it showed nothing; it did not end and was stopped, the rest is missing")


def test_a_tracker_that_fails_is_reported_at_once_and_changes_no_byte(
    tmp_path: Path, untracked: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(launch, "COMMAND", (sys.executable, "-c", FAILS))
    lines: list[str] = []
    with launch.following([tmp_path / FOLDER], ["wandb"], lines.append):
        for _ in range(1000):
            if lines:
                break
            time.sleep(0.05)
        assert lines == ["tracker wandb has ended (it showed nothing); the run goes on without it"]
        train(tmp_path / FOLDER)
    assert tiny_training.contents(tmp_path / FOLDER) == untracked
    assert "it ended early, see" in lines[1]


def test_what_was_dropped_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    _, (line,) = tracked(tmp_path, WRITES, monkeypatch, grace=60.0)
    into = tmp_path / "runs/toy-0.1/synthetic/tracking-0+3/wandb"
    assert line == (
        f"tracker wandb: 7 points and 1 evaluation with episodes in {into}; 2 dropped (OSError: no connection)"
    )


def test_a_tracker_that_cannot_start_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(launch, "COMMAND", (str(tmp_path / "missing"),))
    lines: list[str] = []
    with launch.following([tmp_path / FOLDER], ["wandb"], lines.append):
        train(tmp_path / FOLDER)
    assert "tracker wandb does not run ([Errno 2]" in lines[0]


def test_a_training_resumes_to_the_same_bytes_with_a_tracker(
    tmp_path: Path, untracked: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
):
    """It is killed in epoch 4, after the checkpoint of epoch 2, and is followed before and after."""
    monkeypatch.setattr(launch, "COMMAND", (sys.executable, "-c", WRITES))
    folder = tmp_path / FOLDER
    with launch.following([folder], ["wandb"], lambda line: None):
        killed(folder, 4)
    assert tiny_training.contents(folder) != untracked
    with launch.following([folder], ["wandb"], lambda line: None):
        train(folder)
    assert tiny_training.contents(folder) == untracked


@pytest.mark.slow
def test_a_real_tracker_in_its_own_process_shows_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    program = f"""
import sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
from tests.helpers import tiny_training
tiny_training.install(Path({str(tmp_path / "data")!r}), setattr)
from dextron_bench.tracking import process
process.main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), float(sys.argv[4]))
"""
    monkeypatch.setattr(launch, "COMMAND", (sys.executable, "-c", program))
    lines: list[str] = []
    with launch.following([tmp_path / FOLDER], ["rerun"], lines.append, grace=300.0):
        train(tmp_path / FOLDER)
    into = tmp_path / "runs/toy-0.1/synthetic/tracking-0+3/rerun"
    assert lines == [f"tracker rerun: 16 points and 6 evaluations with episodes in {into}"]
    assert (into / "training.rrd").stat().st_size > 100_000


def test_after_an_error_nobody_waits_for_a_tracker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(launch, "COMMAND", (sys.executable, "-c", "import sys; sys.stdin.read()"))
    lines: list[str] = []
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt), launch.following([tmp_path / FOLDER], ["wandb"], lines.append, 500.0):
        raise KeyboardInterrupt
    assert time.monotonic() - start < 60.0
    assert lines[0].startswith("tracker wandb shows the rest in 500 s at most; counts: ")
