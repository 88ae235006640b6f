"""Each example runs with few steps or episodes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from zipfile import ZipFile

import numpy as np
import pytest
import torch

from dextron_bench.methods.isolation import policy_files

EXAMPLES = Path(__file__).parents[2] / "examples"


def example(name: str) -> ModuleType:
    """The module of an example file."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
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
    training_world: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """In the tiny world, after 40 steps."""
    pytest.importorskip("stable_baselines3")
    board = example("sb3_to_board")
    agent = board.train("synthetic", 40)
    board.save(agent, training_world / "sac.pt")
    states = np.random.default_rng(0).normal(size=(5, 48)).astype(np.float32)
    np.testing.assert_allclose(
        policy_files.load(training_world / "sac.pt").act(states),
        agent.predict(states, deterministic=True)[0],
        atol=1e-6,
    )
    monkeypatch.setattr(board, "train", lambda reaches, steps: agent)
    assert board.main(name="sac", trust=True) == 0
    assert (training_world / "sac-synthetic.zip").exists()
    assert "sac-synthetic.zip: verify it with" in capsys.readouterr().out


def test_each_row_has_a_queue_and_a_new_episode_empties_only_its_own():
    """A queue for all rows would hand out the rest of a chunk that was made for the episode before."""
    board = example("lerobot_to_board")
    policy = board.ChunkPolicy()
    chunk = torch.linspace(0.0, 0.7, board.CHUNK)
    policy.predict_action_chunk = lambda batch: batch["observation.state"][:, :1, None] + chunk[None, :, None]
    agent = board.PolicyPerRow(policy)
    agent.reset(np.arange(2))
    states = np.zeros((2, 48))
    np.testing.assert_allclose(agent.act(states), [[0.0], [0.0]], atol=1e-6)
    np.testing.assert_allclose(agent.act(states), [[0.1], [0.1]], atol=1e-6)
    agent.reset(np.array([1]))
    np.testing.assert_allclose(agent.act(states - 0.5), [[0.2], [-0.5]], atol=1e-6)


def test_the_loss_leaves_out_the_padding_of_a_chunk():
    board = example("lerobot_to_board")
    policy = board.ChunkPolicy()
    policy.predict_action_chunk = lambda batch: torch.zeros(1, board.CHUNK, 1)
    actions = torch.tensor([0.25, 0.75, *[9.0] * (board.CHUNK - 2)])[None, :, None]
    padding = torch.tensor([False, False, *[True] * (board.CHUNK - 2)])[None]
    batch = {board.OBSERVATION: torch.zeros(1, 48), board.ACTION: actions, board.PADDING: padding}
    assert policy(batch).item() == 0.5


@pytest.mark.thorough
def test_a_lerobot_style_policy_ends_as_a_bundle(training_world: Path, capsys: pytest.CaptureFixture[str]):
    """In the tiny world, after 20 updates."""
    board = example("lerobot_to_board")
    data = board.demonstrations("synthetic", episodes=2)
    ends = data[board.PADDING][:, 1].nonzero()[:, 0]  # Only the last step of an episode has no next one.
    assert len(ends) == 2
    first, second = data[board.ACTION][1:, 0], data[board.ACTION][:-1, 1]
    assert torch.equal(first[~data[board.PADDING][:-1, 1]], second[~data[board.PADDING][:-1, 1]])
    trained = board.train(data, steps=20)
    assert trained(data) < board.train(data, steps=0)(data)
    assert board.main(name="ours", episodes=2, steps=20) == 0
    printed = capsys.readouterr().out
    assert "half of the episodes, in another order, get bit-equal actions" in printed
    assert "ours-synthetic.zip: verify it with" in printed
    with ZipFile(training_world / "ours-synthetic.zip") as bundle:
        assert any(name.endswith("ours.safetensors") for name in bundle.namelist())
