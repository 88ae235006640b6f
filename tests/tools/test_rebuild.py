"""`make rebuild` runs the stale steps in order, and knows which they are."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.cli.commands import Group, find
from dextron_bench.world import model
from tools import rebuild, rebuild_steps
from tools.rebuild_steps import STEPS, Step

MAKE = "--version"  # A quick command; the test's steps make their files by copying.
STEPS_HERE = (
    Step("first", (MAKE,), copies=(("a", "dextron_bench/data/a"),)),
    Step("second", (MAKE,), needs=("dextron_bench/data/a",), copies=(("b", "dextron_bench/data/b"),)),
)


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the layout of a checkout and two steps."""
    monkeypatch.chdir(tmp_path)
    for folder in ("leaderboard/results", "dextron_bench/data", "runs"):
        (tmp_path / folder).mkdir(parents=True)
    for name in "ab":
        (tmp_path / "runs" / name).write_text(name)
    monkeypatch.setattr(rebuild, "STEPS", STEPS_HERE)
    return tmp_path


def states(capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    assert rebuild.main(["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    return {name: state for step in STEPS_HERE for name in [step.name] for state in _state(lines, name)}


def _state(lines: list[str], name: str) -> list[str]:
    return [line.split("│")[2].strip() for line in lines if f" {name} " in line]


def test_steps_are_missing_then_fresh_and_run_once(checkout: Path, capsys: pytest.CaptureFixture[str]):
    assert states(capsys) == {"first": "missing", "second": "missing"}
    assert rebuild.main([]) == 0
    assert [line for line in capsys.readouterr().out.splitlines() if line.startswith("rebuild")] == [
        "rebuild: first",
        "rebuild: second",
    ]
    assert states(capsys) == {"first": "fresh", "second": "fresh"}
    assert (checkout / "dextron_bench/data/b").read_text() == "b"
    assert rebuild.main([]) == 0
    assert "rebuild:" not in capsys.readouterr().out


def test_a_changed_input_output_command_or_physics_makes_a_step_stale(
    checkout: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    assert rebuild.main([]) == 0
    capsys.readouterr()
    (checkout / "dextron_bench/data/b").write_text("damaged")
    assert states(capsys) == {"first": "fresh", "second": "stale"}
    (checkout / "dextron_bench/data/a").write_text("other")
    (checkout / "dextron_bench/data/b").write_text("b")
    assert states(capsys) == {"first": "stale", "second": "stale"}
    (checkout / "dextron_bench/data/a").write_text("a")
    assert states(capsys) == {"first": "fresh", "second": "fresh"}
    monkeypatch.setattr(model, "mjcf_hash", lambda: "another world")
    assert states(capsys) == {"first": "stale", "second": "stale"}


def test_a_step_that_fails_stops_the_rebuild_and_stays_missing(
    checkout: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(rebuild, "STEPS", (Step("first", ("data info --reaches nowhere",)), STEPS_HERE[1]))
    assert rebuild.main([]) == 2
    assert "first: `dextron-bench data info --reaches nowhere` ended with code 2" in capsys.readouterr().err
    assert states(capsys) == {"first": "missing", "second": "missing"}


def test_elsewhere_and_with_a_wrong_name_one_line_says_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    assert rebuild.main([]) == 2
    assert "needs a checkout" in capsys.readouterr().err
    assert rebuild.main(["--step", "nothing"]) == 2
    assert "no step 'nothing'; choose from experts-real" in capsys.readouterr().err


@pytest.mark.slow
def test_every_command_of_every_step_is_one_that_the_command_line_accepts():
    """The words are parsed, not run; patterns stand for a file."""
    assert len({step.name for step in STEPS}) == len(STEPS)
    for step in STEPS:
        for command in step.commands:
            words = command.format(runs="runs").replace("*", "x").split()
            assert not isinstance(find(words)[1], Group | None)
            main._parse(words)


def makes(step: Step) -> list[str]:
    """Patterns of the files that a step makes."""
    published = [f"leaderboard/results/{name}/*/*.json" for name in step.publishes]
    weights = [f"{rebuild_steps.WEIGHTS}/{name}/seed*.safetensors" for name in step.publishes]
    return [*step.makes, *(place for _, place in step.copies), *weights, *published]


def overlap(one: str, other: str) -> bool:
    """True if one file can match both patterns: names are compared folder by folder."""
    pairs = list(zip(one.split("/"), other.split("/"), strict=False))
    return one.count("/") == other.count("/") and all(
        fnmatch(a.replace("*", "x"), b) or fnmatch(b.replace("*", "x"), a) for a, b in pairs
    )


def test_a_step_reads_only_what_earlier_steps_make():
    """Databases come before splits, splits before runs, and weights before the success models that use them."""
    for place, step in enumerate(STEPS):
        for need in step.needs:
            makers = [k for k, other in enumerate(STEPS) if any(overlap(need, made) for made in makes(other))]
            assert makers, f"no step makes {need}, which {step.name} reads"
            assert max(makers) < place, f"{STEPS[max(makers)].name} makes {need} after {step.name} has read it"
