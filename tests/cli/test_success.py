"""The success model from the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dextron_bench.cli import main
from dextron_bench.storage import tensors
from dextron_bench.success import generation, training


@pytest.fixture
def here(training_world: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder in the tiny world, with small blocks."""
    monkeypatch.setattr(generation.DatasetConfig.__init__, "__defaults__", ("synthetic", 0, (), 5))
    monkeypatch.setattr(training.TrainingConfig.__init__, "__defaults__", (30, 2, 8, 1e-3, 100, 0))
    monkeypatch.setattr("baselines.bc.STEPS", 2)
    return training_world


@pytest.mark.slow
def test_a_data_set_with_policies_and_a_model_trained_on_it(here: Path, capsys: pytest.CaptureFixture[str]):
    run = ["run", "--method", "bc", "--preset", "smoke", "--split", "test", "--quiet", "--record", "0"]
    assert main.main(run) == 0
    words = ["--policies", "runs/bc-smoke/synthetic/seed0/weights.safetensors", "--rows", "1500", "--quiet"]
    capsys.readouterr()
    assert main.main(["success", "data", *words, "--json"]) == 0
    rows = {row["kind"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows.keys() >= {"solved", "policy", "all"}
    assert rows["solved"]["success_rate"] == 1.0
    assert rows["all"]["rows"] == sum(row["rows"] for kind, row in rows.items() if kind != "all") >= 1500
    assert main.main(["success", "train", "--epochs", "2", "--quiet"]) == 0
    assert "model.safetensors" in capsys.readouterr().out
    assert [
        point["epoch"] for point in tensors.read_about(here / "runs/success/synthetic/seed0" / training.MODEL)["curve"]
    ] == [1, 2]
    assert main.main(["success", "eval", "--split", "test", *words[:2], "--json"]) == 0
    experts, policy = json.loads(capsys.readouterr().out)
    assert (experts["split"], experts["player"], policy["player"]) == ("test", "experts", words[1])
    assert 0.0 < experts["base_rate"] < 1.0  # The experts of the rows succeed, randomly drawn ones do not.
    assert sum(experts["predictions"]) == experts["rows"]
    assert len(experts["auc_by_time"]) == 11
    assert main.main(["success", "eval", "--split", "test", *words[:2], "--markdown"]) == 0
    scores, by_time, calibration = capsys.readouterr().out.split("\n\n")
    shares = [f"{100 * experts[name]:.1f}" for name in ("base_rate", "accuracy", "base_accuracy")]
    assert scores.splitlines()[2].startswith(f"| `test` | experts | {experts['rows']:,} | {' | '.join(shares)} |")
    assert [line.split(" | ")[1] for line in by_time.splitlines()[2:]] == ["experts", "bc-smoke"]
    assert len(calibration.splitlines()) == 4
    assert main.main(["success", "eval", "--split", "test"]) == 0
    assert main.main(["success", "explain", *words[:2], "--into", "pictures/fig5.png"]) == 0
    assert "expert" in capsys.readouterr().out
    assert (here / "pictures" / "fig5.png").exists()


def test_an_error_is_one_line(here: Path, complaint: Callable[..., str]):
    assert "make one with `dextron-bench success data`" in complaint("success", "train", "--quiet")
    assert "No such file" in complaint("success", "data", "--policies", "none.safetensors")
    assert "--rows and --settings must be 1 or more" in complaint("figures", "--settings", "0")
    assert "--rows is the number of transitions" in complaint("success", "data", "--rows", "0")
    tensors.write(here / "odd.safetensors", {"a": np.zeros(2)}, {})
    assert "does not say which method's weights" in complaint("success", "data", "--policies", "odd.safetensors")


def test_wrong_arguments_point_to_the_help_of_their_command(capsys: pytest.CaptureFixture[str]):
    for arguments, command in (
        (["success", "data", "--nope"], "success data"),
        (["success", "nope"], "success"),
        (["nope"], ""),
    ):
        with pytest.raises(SystemExit):
            main.main(arguments)
        assert capsys.readouterr().err.endswith(f"see `{f'dextron-bench {command}'.strip()} --help`\n")
