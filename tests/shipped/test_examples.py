"""Each example runs with few steps or episodes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from dextron_bench.methods.isolation import policy_files
from tests.helpers import tiny_benchmark, tiny_training

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


@pytest.mark.slow
def test_a_training_with_stable_baselines_ends_as_a_bundle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """In the tiny world, after 40 steps."""
    pytest.importorskip("stable_baselines3")
    tiny_training.install(tiny_training.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.chdir(tmp_path)
    board = example("sb3_to_board")
    agent = board.train("synthetic", 40)
    board.save(agent, tmp_path / "sac.pt")
    states = np.random.default_rng(0).normal(size=(5, 48)).astype(np.float32)
    np.testing.assert_allclose(
        policy_files.load(tmp_path / "sac.pt").act(states), agent.predict(states, deterministic=True)[0], atol=1e-6
    )
    monkeypatch.setattr(board, "train", lambda reaches, steps: agent)
    assert board.main(name="sac", trust=True) == 0
    assert (tmp_path / "sac-synthetic.zip").exists()
    assert "sac-synthetic.zip: verify it with" in capsys.readouterr().out
    tiny_benchmark.forget()
