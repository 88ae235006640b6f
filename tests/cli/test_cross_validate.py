"""`cross-validate` through the real command line: what is learned from and played, an interruption, errors."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.methods import registry
from dextron_bench.methods.learners import TrainingSetup
from dextron_bench.reaches.setting import Setting
from dextron_bench.splits import strata
from dextron_bench.splits.loading import Split
from dextron_bench.storage import tensors
from dextron_bench.sweeps import cross_validation
from tests.helpers import tiny_benchmark, tiny_training
from tests.helpers.interruptions import Interruptions
from tests.helpers.tiny_training import TOY, TRANSFER

AGAIN = pd.DataFrame(
    [("val", *tiny_benchmark.SOLVED[1]), ("train", *tiny_benchmark.SOLVED[1])], columns=tiny_benchmark.COLUMNS
)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The tiny world, whose reaches are of subjects `A` and `B`; `train` has the setting of `A` twice."""
    rows = pd.concat([tiny_benchmark.ROWS, tiny_training.TRAIN, AGAIN])
    tiny_training.install(tiny_benchmark.write(tmp_path / "data", rows), monkeypatch.setattr)

    def subjects(split: Split) -> pd.DataFrame:
        return pd.DataFrame({"subject": [case.setting.reach.upper() for case in split.cases]})

    monkeypatch.setattr(strata, "strata", subjects)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    tiny_benchmark.forget()


def validate(*words: str, method: str = TOY, beside: Sequence[str] = ("exp",)) -> list[str]:
    preset = ["--preset", "smoke"] if method == TOY else []
    return ["sweep", "cross-validate", "--method", method, *preset, "--beside", *beside, "--quiet", *words]


@pytest.mark.slow
def test_a_method_learns_without_each_subject_and_plays_its_settings(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    learned: list[set[str]] = []
    toy: Any = registry.find_method(TOY)
    trainer = toy.trainer

    def noting(self: Any, setup: TrainingSetup, seeds: Sequence[int]) -> Any:
        learned.append({case.setting.reach for case in setup.cases})
        return trainer(self, setup, seeds)

    monkeypatch.setattr(toy, "trainer", noting)
    assert main.main(validate("--seed", "0", "3", "--json")) == 0
    assert learned == [{"b"}, {"a"}]
    rows = json.loads(capsys.readouterr().out)
    assert [(row["subject"], row["settings"]) for row in rows] == [("A", 1), ("B", 1), ("all", 2)]
    assert [row["methods"]["exp"]["success"]["mean"] for row in rows] == [1.0, 1.0, 1.0]
    assert set(rows[0]["methods"]) == {"toy-0.1", "exp"}
    for subject in "AB":
        assert sorted(place.name for place in here.glob(f"runs/without/{subject}/toy-0.1/synthetic/seed*")) == [
            "seed0", "seed3"
        ]  # fmt: skip
        weights = here / f"runs/without/{subject}/toy-0.1/synthetic/seed0/weights.safetensors"
        assert tensors.read_about(weights)["without"] == subject
        files = list(here.glob(f"runs/without/{subject}/*/synthetic/seed*/left-out.json"))
        assert len(files) == 3  # Two seeds of the learner, and the first one of the expert.
    assert main.main(validate("--seed", "0", "3", "--markdown")) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "| subject | settings | toy-0.1, success % [95 %] | exp, success % [95 %] |"
    assert lines[-1].startswith("| all | 2 | ")
    assert len(learned) == 2  # Nothing was trained again.


@pytest.mark.slow
def test_an_interrupted_command_continues_with_equal_files(here: Path, monkeypatch: pytest.MonkeyPatch):
    assert main.main(validate("--runs", "whole")) == 0
    Interruptions(monkeypatch).finish(lambda: main.main(validate("--runs", "broken")))
    assert tiny_training.contents(here / "broken") == tiny_training.contents(here / "whole")


def test_scores_of_other_weights_are_played_again(here: Path):
    assert main.main(validate(beside=())) == 0
    file = here / "runs/without/A/toy-0.1/synthetic/seed0/left-out.json"
    content = json.loads(file.read_text())
    file.write_text(json.dumps(content | {"scores": [3.5]}))
    assert main.main(validate(beside=())) == 0
    assert json.loads(file.read_text())["scores"] == [3.5]
    stale = content["depends on"] | {"weights": "0" * 64}
    file.write_text(json.dumps(content | {"depends on": stale, "scores": [3.5]}))
    assert main.main(validate(beside=())) == 0
    assert json.loads(file.read_text()) == content


def test_each_setting_counts_once():
    first, second = Setting("a", 0.0, 0.0, 0.0), Setting("b", 0.0, 0.0, 0.0)
    rows = [(first, 0.1), (second, 0.2), (first, 0.3)]
    cases = tuple(Case(setting, Expert(1.0, critical), 0.1) for setting, critical in rows)
    assert cross_validation._once(Split(name="train", reaches="synthetic", digest="0", cases=cases)).cases == cases[:2]


def test_an_error_is_one_line(here: Path, complaint: Callable[..., str], monkeypatch: pytest.MonkeyPatch):
    assert "plays a policy that was trained on other reaches" in complaint(*validate(method=TRANSFER))
    assert "is always trained on minjerk reaches" in complaint(*validate(method=tiny_training.MINJERK_TOY))
    assert "no method 'nix'" in complaint(*validate(beside=["nix"]))
    monkeypatch.setattr(strata, "strata", lambda split: pd.DataFrame({"subject": ["A"] * len(split.cases)}))
    assert "have one subject; none can be left out" in complaint(*validate())
