"""The recordings to show: each method's shortest success and failure, and exemplars of the success model."""

from __future__ import annotations

from pathlib import Path

import pytest

from dextron_bench import recording
from dextron_bench.catalogue import episodes
from dextron_bench.cli import main
from dextron_bench.leaderboard import highlights
from dextron_bench.success import network
from tests.helpers import fixed_success_model


@pytest.fixture
def runs(two_runs: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two runs of two episodes in the tiny world: one solves both, the other neither."""
    model = fixed_success_model.model(0.9, slope=-8.0)  # It predicts success for most actions.
    monkeypatch.setattr(network, "shipped_model", lambda reaches: model)
    return two_runs / "runs"


@pytest.mark.slow
def test_each_method_has_its_shortest_episodes_and_each_kind_its_clearest(runs: Path):
    chosen = highlights.choose(runs, ["synthetic"], "test", rows=100)
    names = chosen["name"].tolist()
    assert names[:2] == ["exp-success", "nothing-failure"]
    assert "case-expert" in names
    table = episodes.read([runs])
    shortest = table[table["method"] == "exp"]["steps"].min()
    assert chosen["steps"].iloc[0] == shortest
    files = highlights.make(chosen, runs / "chosen")
    assert [file.stem for file in files] == names
    for file, score in zip(files, chosen["return"], strict=True):
        assert recording.read(file).episode.score == score


def test_exemplars_are_of_any_method_and_outcomes_of_the_methods_that_are_named(runs: Path):
    every, few = (highlights.choose(runs, ["synthetic"], "test", 100, methods) for methods in ((), ("nothing",)))
    assert few["name"].tolist() == [name for name in every["name"] if name != "exp-success"]
    assert few["name"].iloc[0] == "nothing-failure"
    assert "case-expert" in set(few["name"])


def test_the_command_copies_the_recordings(runs: Path, capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()
    assert main.main(["recordings", "choose", "--into", "few", "--rows", "1"]) == 0
    assert "nothing-failure.rrd" in capsys.readouterr().out
    assert (runs.parent / "few" / "exp-success.rrd").exists()


def test_without_a_model_there_are_only_successes_and_failures(runs: Path, monkeypatch: pytest.MonkeyPatch):
    def missing(reaches: str) -> object:
        raise network.MissingModel(reaches)

    monkeypatch.setattr(network, "shipped_model", missing)
    chosen = highlights.choose(runs, ["minjerk", "synthetic"], "test", rows=100)
    assert chosen["name"].tolist() == ["exp-success", "nothing-failure"]
    assert set(chosen["reaches"]) == {"synthetic"}


def test_a_split_that_no_run_played_is_an_error(runs: Path):
    with pytest.raises(episodes.NoEpisodes, match=r"no run in .* played open of synthetic reaches"):
        highlights.choose(runs, ["synthetic"], "open", rows=100)
