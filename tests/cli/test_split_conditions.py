"""Every command that plays a split plays its conditions, too: it plays the episodes of `run`, bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from dextron_bench import recording
from dextron_bench.cli import main
from dextron_bench.evaluation import rollout
from dextron_bench.reaches.setting import Setting
from dextron_bench.splits import loading
from dextron_bench.world.bottles import model_bottle
from tests.helpers import tiny_benchmark

SPLITS = ("test+delay-200", "test+bottle-mass")
Played = set[tuple[Setting, bytes]]  # Settings, and the states of their episodes.


@pytest.fixture
def world(tmp_path: Path) -> Iterator[Path]:
    """A working folder in the tiny world, whose `test` has heavy bottles, too."""
    with tiny_benchmark.working_folder(tmp_path):
        rows = tiny_benchmark.ROWS[tiny_benchmark.ROWS["split"] == "test"]
        heavy = rows.assign(**{**asdict(model_bottle()), "mass": (2.0, 3.0)}, split=SPLITS[1])
        tiny_benchmark.write(tmp_path / "data", heavy, loading.bottles_file("synthetic"))
        tiny_benchmark.forget()
        yield tmp_path


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch) -> Callable[[Sequence[str]], Played]:
    """Runs a command; returns the episodes that it plays."""
    run, played = rollout._Evaluation.run, Played()

    def watched(evaluation: Any) -> Iterator[Any]:
        for index, episode in run(evaluation):
            played.add((episode.setting, episode.states.tobytes()))
            yield index, episode

    def play(words: Sequence[str]) -> Played:
        played.clear()
        assert main.main(list(words)) == 0
        return set(played)

    monkeypatch.setattr(rollout._Evaluation, "run", watched)
    return play


def run(split: str) -> list[str]:
    """The words that play experts on a split."""
    return ["run", "--method", "exp", "--split", split, "--record", "0", "--quiet"]


@pytest.mark.parametrize("split", SPLITS)
def test_the_conditions_of_a_split_change_its_episodes(
    world: Path, play: Callable[[Sequence[str]], Played], split: str
):
    plain, changed = play(run("test")), play(run(split))
    assert len(plain) == len(changed) == 2
    assert not plain & changed


@pytest.mark.slow
@pytest.mark.parametrize("split", SPLITS)
@pytest.mark.parametrize(
    "words",
    [
        ("data", "export", "--into", "sets", "--quiet"),
        ("windows", "exp", "--quiet"),
        ("success", "eval"),
        ("success", "explain"),
        ("view", "--live", "--method", "exp", "--row", "0", "1", "--speed", "0"),
        ("recordings", "choose", "--into", "chosen"),
    ],
    ids=lambda words: "-".join(words[:2]),
)
def test_a_command_plays_the_episodes_of_run(
    world: Path,
    play: Callable[[Sequence[str]], Played],
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    split: str,
):
    @contextmanager
    def viewer() -> Iterator[Any]:
        yield lambda stream: stream.save("live.rrd"), lambda: None

    if words[:2] == ("data", "export"):
        pytest.importorskip("minari", reason="Minari is not installed: pip install -e '.[minari]'")
    monkeypatch.setattr(recording, "open_live_viewer", viewer)
    expected = play(run(split))
    assert expected <= play([*words, "--split", split, "--reaches", "synthetic"])
