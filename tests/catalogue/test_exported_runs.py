"""What is exported of runs that are done, going on, killed, failed and damaged."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from dextron_bench.catalogue import exported_runs, run_catalogue
from dextron_bench.catalogue.exported_runs import ExportedRun
from dextron_bench.runs import annotations, playing
from dextron_bench.storage.atomic import DamagedFile
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.training.checkpoints import Checkpoints
from tests.catalogue.test_run_catalogue import write_run

TRAINING = "learner/real/training-0+1"
BEGAN, ENDED = "2026-01-01T01:00:00+00:00", "2026-01-01T02:30:00+00:00"


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """`mine`, done; two seeds of `learner`, which train together and have not written a metric yet."""
    mine = write_run(tmp_path, "mine", 0, [20.0, 10.0], near=0.08)
    mine.times.write_text(json.dumps({"began": BEGAN, "ended": ENDED}))
    annotations.write(tmp_path / "mine/real", annotations.Notes(("good",), "two\nlines"))
    for seed in (0, 1):
        write_run(tmp_path, "learner", seed, None)
    (tmp_path / TRAINING).mkdir()
    return tmp_path


def collect(runs: Path) -> tuple[dict[str, ExportedRun], list[str]]:
    exported, left_out = exported_runs.collect(run_catalogue.entries(runs))
    return {run.name: run for run in exported}, left_out


def metrics(run: ExportedRun) -> list[tuple[str, float, int]]:
    return [(metric.name, metric.value, metric.step) for metric in run.metrics]


def test_a_run_that_is_done_has_its_settings_scores_tags_and_times(runs: Path):
    mine = collect(runs)[0]["mine/real/seed0"]
    assert (mine.state, mine.times.began, mine.times.ended) == (
        "FINISHED",
        datetime(2026, 1, 1, 1, tzinfo=UTC),
        datetime(2026, 1, 1, 2, 30, tzinfo=UTC),
    )
    assert mine.params == {"method": "mine", "reaches": "real", "seed": "0", "physics": "p", "near": "0.08"}
    assert mine.tags == {"good": "true", "mlflow.note.content": "two\nlines"}
    assert metrics(mine) == [("test.return", 15.0, 0), ("test.success", 0.5, 0)]


def test_a_training_in_its_first_epoch_is_exported_as_it_is(runs: Path):
    """Its metrics are not there yet, and nothing is damaged."""
    with Checkpoints(runs / TRAINING, (0, 1)).locked():
        exported, left_out = collect(runs)
    assert {name: run.state for name, run in exported.items()} == {
        "learner/real/seed0": "RUNNING",
        "learner/real/seed1": "RUNNING",
        "mine/real/seed0": "FINISHED",
    }
    assert left_out == []


def test_a_training_that_was_killed_while_it_wrote_has_its_whole_lines(runs: Path):
    rows = [{"epoch": 1, "seed": seed, "score": 2.5 - seed} for seed in (0, 1)]
    text = "".join(json.dumps(row) + "\n" for row in rows)
    (runs / TRAINING / "metrics.jsonl").write_text(text + '{"epoch": 2, "se')
    exported, left_out = collect(runs)
    assert [metrics(exported[f"learner/real/seed{seed}"]) for seed in (0, 1)] == [
        [("train.score", 2.5, 1)],
        [("train.score", 1.5, 1)],
    ]
    assert (exported["learner/real/seed0"].state, left_out) == ("KILLED", [])


def test_a_run_that_failed_says_why(runs: Path):
    with pytest.raises(ZeroDivisionError), annotations.noting_failure([RunFolder.of(runs, "learner", "real", 0)]):
        _ = 1 / 0
    exported, _ = collect(runs)
    failed, other = exported["learner/real/seed0"], exported["learner/real/seed1"]
    assert (failed.state, failed.tags) == ("FAILED", {"failure": "ZeroDivisionError: division by zero"})
    assert failed.times.ended is not None
    assert other.state == "KILLED"


def test_a_run_that_plays_is_running(runs: Path, monkeypatch: pytest.MonkeyPatch):
    def played(run: RunFolder) -> str:
        return "1 of 2 episodes" if run.label == "mine" else ""

    monkeypatch.setattr(playing, "state", played)
    assert collect(runs)[0]["mine/real/seed0"].state == "RUNNING"


def test_a_seed_has_its_own_scores_if_an_earlier_seed_has_none(runs: Path):
    write_run(runs, "mine", 1, [0.0, 20.0], near=0.08)
    RunFolder.of(runs, "mine", "real", 0).result.unlink()
    exported, _ = collect(runs)
    assert metrics(exported["mine/real/seed0"]) == []
    assert metrics(exported["mine/real/seed1"])[0] == ("test.return", 10.0, 0)


def test_a_run_with_a_damaged_config_is_left_out_by_name(runs: Path):
    (runs / "mine/real/seed0/config.json").write_text("{")
    with pytest.raises(DamagedFile, match=r"config\.json"):
        run_catalogue.entries(runs)
    unreadable: list[str] = []
    assert [entry.name for entry in run_catalogue.entries(runs, unreadable)] == ["learner/real"]
    [line] = unreadable
    assert line.startswith("mine/real is left out: ")


def test_a_damaged_run_is_left_out_by_name_and_the_others_are_exported(runs: Path):
    (runs / TRAINING / "metrics.jsonl").write_text('no JSON\n{"epoch": 1, "seed": 0}\n')
    exported, left_out = collect(runs)
    assert list(exported) == ["mine/real/seed0"]
    assert [line.split(" is left out: ")[0] for line in left_out] == ["learner/real/seed0", "learner/real/seed1"]
    assert "metrics.jsonl: line 1 does not hold the metrics of an epoch" in left_out[0]
