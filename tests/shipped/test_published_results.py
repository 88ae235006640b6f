"""The package reproduces the published leaderboard: results, tables, page and the weights that ship."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec import to_builtins

import baselines
from dextron_bench.cli import main
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.methods import registry, weights
from dextron_bench.methods.learners import Learner
from dextron_bench.reaches.setting import Source
from dextron_bench.runs import result_files
from dextron_bench.splits.loading import load_split, ranking_splits
from dextron_bench.training import learning_curve

BOARD = Path(__file__).parents[2] / "leaderboard"
RESULTS = sorted((BOARD / "results").glob("*/*/seed*/result.json"))
QUICK = ("bc/real/seed0", "rlil-0.1/synthetic/seed0", "stopping/real/seed0")  # Replayed without the slow tests, too.
WEIGHTS = sorted((Path(baselines.__file__).parent / "weights").glob("*/*/seed*.safetensors"))


def name(file: Path) -> str:
    """Method, source of reaches and seed of a file, as `<label>/<reaches>/seed<k>`."""
    return "/".join([*file.parts[-4:-1]] if file.name == "result.json" else [*file.parts[-3:-1], file.stem])


@pytest.mark.parametrize("file", RESULTS, ids=name)
def test_a_result_is_complete_and_uses_the_splits_that_ship(file: Path):
    result = result_files.read_result(file)
    assert name(file) == f"{result.method}/{result.reaches}/seed{result.seed}"
    for split_name in ranking_splits(result.reaches):
        split, published = load_split(result.reaches, split_name), result.splits[split_name]
        assert published.digest == split.digest
        assert len(published.scores) == sum(published.causes.values()) == len(split.cases)
        assert published.causes.get("solved", 0) == published.scores.count(20.0)
        assert published.failed == 0


@pytest.mark.parametrize("file", (BOARD / "results/exp").glob("*/seed0/result.json"), ids=name)
def test_experts_solve_every_row_of_the_splits_that_can_be_solved(file: Path):
    splits = result_files.read_result(file).splits
    assert "hard" in splits
    for split_name, split in splits.items():
        assert split_name == "open" or set(split.scores) == {20.0}


@pytest.mark.slow
def test_tables_curves_and_page_are_rebuilt_from_the_results(tmp_path: Path):
    rebuilt = tmp_path / "board"
    shutil.copytree(BOARD, rebuilt)
    (tmp_path / "recordings").symlink_to(BOARD.parent / "recordings")
    assert main.main(["leaderboard", "build", "--board", str(rebuilt)]) == 0
    for file in ("README.md", "table.csv", "table.json", "index.html"):
        assert (rebuilt / file).read_text() == (BOARD / file).read_text()
    assert {file.name for file in rebuilt.glob("*.png")} == {file.name for file in BOARD.glob("*.png")}


@pytest.mark.parametrize("file", WEIGHTS, ids=name)
def test_weights_that_ship_made_the_published_result(file: Path):
    result = result_files.read_result(BOARD / "results" / name(file) / "result.json")
    assert result.training is not None
    assert to_builtins(result.training).items() >= weights.metadata(file).items()
    points = learning_curve.read(BOARD / "results" / name(file) / "curve.json")
    assert result.training.best_epoch in [point.epoch for point in points]


@pytest.mark.parametrize(
    ("file", "rows"),
    [
        *(pytest.param(file, 2, id=f"{name(file)}-2") for file in WEIGHTS if name(file) in QUICK),
        *(
            pytest.param(file, 4, id=f"{name(file)}-4", marks=pytest.mark.slow)
            for file in WEIGHTS
            if "seed0" in name(file)
        ),
        *(pytest.param(file, 8, id=f"{name(file)}-8", marks=pytest.mark.thorough) for file in WEIGHTS),
    ],
)
def test_weights_that_ship_reproduce_the_published_scores(file: Path, rows: int, opened: Callable[[str], Source]):
    """The episodes are equal bit for bit, so returns are equal; `dextron-bench eval` does the same for every row."""
    reaches, learner = file.parent.name, registry.create(*weights.maker_of(file))
    assert isinstance(learner, Learner)
    split = load_split(reaches, "test")
    agent, source = weights.load_agent(learner, file), opened(reaches)
    scores = {row: episode.score for row, episode in rollout(agent, source, split.cases[:rows])}
    result = result_files.read_result(BOARD / "results" / name(file) / "result.json")
    assert [scores[row] for row in range(rows)] == result.splits["test"].scores[:rows]
