"""The published leaderboard: `build` copies finished runs into it, and computes tables and page from its results."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from dextron_bench.cli import main
from dextron_bench.evaluation.diagnosis import CAUSES
from dextron_bench.leaderboard import collect
from dextron_bench.methods import weights
from dextron_bench.runs import result_files
from dextron_bench.scores import standings
from tests.helpers import tiny_training

TOY = "tests.helpers.toy_learner:Toy"
QUIET = ("--quiet", "--record", "0")


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with runs of the toy learner (two seeds) and of `nothing` on the tiny benchmark."""
    with tiny_training.working_folder(tmp_path_factory.mktemp("built")) as folder:
        assert main.main(["run", "--method", TOY, "--preset", "quick", "--seed", "0", "1", *QUIET]) == 0
        assert main.main(["run", "--method", "nothing", *QUIET]) == 0
    return folder


@pytest.fixture
def here(training_world: Path, played: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a copy of these runs, and a folder for the weights that ship."""
    monkeypatch.setattr(
        weights, "shipped_folder", lambda learner, reaches: training_world / "shipped" / learner.label / reaches
    )
    shutil.copytree(played, training_world, dirs_exist_ok=True)
    return training_world


def build(*words: str) -> int:
    return main.main(["leaderboard", "build", "--board", "board", *words])


@pytest.mark.slow
def test_results_curves_and_weights_are_copied_unchanged(here: Path):
    assert build("--runs", "runs") == 0
    run, published = here / "runs/toy-0.1/synthetic/seed1", here / "board/results/toy-0.1/synthetic/seed1"
    assert sorted(file.name for file in published.iterdir()) == ["curve.json", "result.json"]
    for name in ("curve.json", "result.json"):
        assert (published / name).read_bytes() == (run / name).read_bytes()
    shipped = here / "shipped/toy-0.1/synthetic/seed1.safetensors"
    assert shipped.read_bytes() == (run / "weights.safetensors").read_bytes()
    assert [file.name for file in (here / "board/results/nothing/synthetic/seed0").iterdir()] == ["result.json"]


def test_the_tables_are_computed_from_the_results(here: Path):
    assert build("--runs", "runs") == 0
    rows = standings.table(result_files.results(here / "runs"))
    written = pd.read_csv(here / "board/table.csv")
    assert written["method"].tolist() == rows["method"].tolist()
    assert written["return"].to_numpy() == pytest.approx(rows["return"].to_numpy())
    text = (here / "board/README.md").read_text()
    row = rows[(rows["method"] == "toy-0.1") & (rows["split"] == "test")].iloc[0]
    cell = f"{row['return']:.2f} [{row['return_low']:.2f}, {row['return_high']:.2f}], {100 * row['success']:.1f} %"
    assert f"| `toy-0.1` | 2 | self-reported | {cell} |" in text
    records = json.loads((here / "board/table.json").read_text())
    assert [record["tier"] for record in records] == written["tier"].tolist()
    assert [record["frames"] for record in records if record["method"] == "nothing"] == [None, None]
    shares = [f"{25.0 * row[cause]:.1f}" for cause in CAUSES]  # Two seeds with two episodes each.
    assert f"| `toy-0.1` | {' | '.join(shares)} |" in text
    assert (here / "board/curves-synthetic.png").stat().st_size > 5000


@pytest.mark.slow
def test_handwritten_text_stays_and_a_second_build_changes_nothing(here: Path):
    assert build("--runs", "runs") == 0
    readme = here / "board/README.md"
    readme.write_text(readme.read_text().replace("# Leaderboard", "# Ours\n\nBefore.") + "\nAfter.\n")
    assert build() == 0
    before = readme.read_text()
    assert before.startswith("# Ours\n\nBefore.\n")
    assert before.endswith("\nAfter.\n")
    assert build() == 0
    assert readme.read_text() == before


@pytest.mark.slow
def test_an_unfinished_run_is_not_published(here: Path, complaint: Callable[..., str]):
    for file in (here / "runs").glob("*/*/seed*/result.json"):
        result = json.loads(file.read_text())
        result["splits"].pop("unseen-reach")
        file.write_text(json.dumps(result))
    line = complaint("leaderboard", "build", "--runs", "runs", "--board", "board")
    assert "no run in runs holds all splits that rank methods" in line
    assert not (here / "board").exists()


@pytest.mark.slow
def test_the_tier_stays_until_the_scores_change(here: Path):
    assert build("--runs", "runs") == 0
    file = here / "board/results/nothing/synthetic/seed0/result.json"
    verified = json.loads(file.read_text()) | {"tier": "re-run"}
    file.write_text(json.dumps(verified))
    assert build("--runs", "runs") == 0
    assert json.loads(file.read_text())["tier"] == "re-run"
    verified["splits"]["test"]["scores"][0] = 20.0
    file.write_text(json.dumps(verified))
    assert build("--runs", "runs") == 0
    assert "tier" not in json.loads(file.read_text())


@pytest.mark.slow
def test_val_of_a_learner_is_not_published_because_its_snapshot_was_chosen_there(here: Path):
    for method in (TOY, "nothing"):
        words = ["--preset", "quick"] if method == TOY else []
        assert main.main(["run", "--method", method, *words, "--split", "val", *QUIET]) == 0
    assert build("--runs", "runs") == 0
    splits = {
        label: list(json.loads((here / f"board/results/{label}/synthetic/seed0/result.json").read_text())["splits"])
        for label in ("toy-0.1", "nothing")
    }
    assert splits["toy-0.1"] == ["test", "unseen-reach"]
    assert sorted(splits["nothing"]) == ["test", "unseen-reach", "val"]


@pytest.mark.slow
def test_what_a_verification_adds_to_a_result_does_not_change_the_hash_of_the_run(here: Path):
    assert build("--runs", "runs") == 0
    file = here / "board/results/nothing/synthetic/seed0/result.json"
    result, digest = json.loads(file.read_text()), collect.run_digest(file)
    result["splits"]["test"]["actions"] = ["ab", "cd"]
    file.write_text(json.dumps({**result, "tier": "re-run"}))
    assert collect.run_digest(file) == digest
    result["splits"]["test"]["scores"][0] = 20.0
    file.write_text(json.dumps(result))
    assert collect.run_digest(file) != digest


@pytest.mark.slow
def test_no_cell_of_the_table_is_a_formula_and_nothing_hidden_is_published(here: Path):
    assert build("--runs", "runs") == 0
    file = here / "board/results/nothing/synthetic/seed0/result.json"
    result = json.loads(file.read_text())
    result["provenance"]["machine"] = {"cpu": '=HYPERLINK("http://x")\x1b[2J\u202e', "cores": None}
    file.write_text(json.dumps(result))
    assert build() == 0
    (cell,) = {
        row["hardware"] for row in csv.DictReader((here / "board/table.csv").open()) if row["method"] == "nothing"
    }
    assert cell == '\'=HYPERLINK("http://x")\\x1b[2J\\u202e'
    for name in ("table.csv", "README.md", "index.html"):
        assert not {"\x1b", "\u202e"} & set((here / "board" / name).read_text())
