"""Each example runs with few steps or episodes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> ModuleType:
    """The module of an example file."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_random_actions_through_gymnasium(capsys: pytest.CaptureFixture[str]):
    finished = example("gymnasium_random").main(steps=250)
    assert finished > 0
    assert capsys.readouterr().out.count("minjerk-") == finished


def test_the_expert_through_dm_control():
    assert example("dm_control_expert").main(episodes=1)[0] > 1.0


@pytest.mark.slow
def test_sac_of_stable_baselines(capsys: pytest.CaptureFixture[str]):
    pytest.importorskip("stable_baselines3")
    example("sb3_sac").main(steps=40, episodes=1)
    assert "mean return" in capsys.readouterr().out
