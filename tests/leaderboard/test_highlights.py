"""A choice of recordings: each method's shortest success and failure, and the kinds of cases."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from dextron_bench import recording
from dextron_bench.cli import main
from dextron_bench.leaderboard import highlights
from dextron_bench.runs import selection
from dextron_bench.success import network
from tests.helpers import fixed_success_model, tiny_benchmark


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Two runs of two episodes each, in the tiny world: one solves them, the other does not."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.chdir(tmp_path)
    model = fixed_success_model.model(0.9, slope=-8.0)  # It predicts success for most actions.
    monkeypatch.setattr(network, "shipped_model", lambda reaches: model)
    words = ["--split", "test", "--no-floors", "--quiet", "--json", "--record", "0"]
    for method in ("exp", "nothing"):
        assert main.main(["run", "--method", method, *words]) == 0
    yield tmp_path / "runs"
    tiny_benchmark.forget()


def test_each_methods_shortest_and_each_kind_of_case(runs: Path):
    chosen = highlights.choose(runs, ["synthetic"], "test", rows=100)
    names = chosen["name"].tolist()
    assert names[:2] == ["exp-success", "nothing-failure"]
    assert "case-expert" in names
    table = selection.episodes([runs])
    shortest = table[table["method"] == "exp"]["length"].min()
    assert chosen["length"].iloc[0] == shortest
    files = highlights.make(chosen, runs / "chosen")
    assert [file.stem for file in files] == names
    for file, score in zip(files, chosen["score"], strict=True):
        assert recording.read(file).episode.score == score


def test_from_the_command_line(runs: Path, capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()
    assert main.main(["recordings", "choose", "--into", "few", "--rows", "1"]) == 0
    assert "nothing-failure.rrd" in capsys.readouterr().out
    assert (runs.parent / "few" / "exp-success.rrd").exists()


def test_a_method_is_shown_where_it_played_and_without_a_model_there_are_no_cases(
    runs: Path, monkeypatch: pytest.MonkeyPatch
):
    def missing(reaches: str) -> object:
        raise network.MissingModel(reaches)

    monkeypatch.setattr(network, "shipped_model", missing)
    chosen = highlights.choose(runs, ["minjerk", "synthetic"], "test", rows=100)
    assert chosen["name"].tolist() == ["exp-success", "nothing-failure"]
    assert set(chosen["reaches"]) == {"synthetic"}


def test_no_runs_of_the_split_is_told(runs: Path):
    with pytest.raises(selection.NoEpisodes, match=r"no run in .* played open of synthetic reaches"):
        highlights.choose(runs, ["synthetic"], "open", rows=100)
