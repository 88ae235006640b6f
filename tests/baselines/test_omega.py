"""OMEGA: the chosen actions for curves made by hand, and the model that it uses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from baselines.omega import Omega, OmegaAgent, choose
from dextron_bench.cli import main
from dextron_bench.errors import BadInput
from dextron_bench.methods import registry
from dextron_bench.storage import hashing
from dextron_bench.success.network import GRID, SuccessModel
from tests.helpers import fixed_success_model


def curves(*points: dict[float, float], elsewhere: float = 0.1) -> np.ndarray:
    """Curves (N, 51) with given probabilities at given actions, and `elsewhere` at all others."""
    rows = np.full((len(points), len(GRID)), elsewhere)
    for row, probabilities in zip(rows, points, strict=True):
        for action, probability in probabilities.items():
            row[np.abs(GRID - action).argmin()] = probability
    return rows


def chosen(probabilities: dict[float, float], preferred: float, tolerance: float = 0.05) -> float:
    return float(choose(curves(probabilities), np.array([preferred]), tolerance)[0])


def states(*distances: float) -> np.ndarray:
    """States (N, 48) of upright hands with given distances from palm centre to bottle axis [m]."""
    rows = np.zeros((len(distances), 48))
    rows[:, [3, 10]] = 1.0
    rows[:, 7], rows[:, 8] = distances, -0.09  # The palm centre is 0.09 m ahead of the palm.
    return rows


def agent(best: float, slope: float = 8.0, tolerance: float = 0.02) -> OmegaAgent:
    """An agent with a model that predicts the action `best` as the best one, reset for three episodes."""
    omega = OmegaAgent(fixed_success_model.model(best, slope), tolerance, near=0.1)
    omega.reset(np.arange(3))
    return omega


def test_the_best_action_is_taken():
    assert chosen({0.4: 0.9, -0.6: 0.7}, preferred=-1.0) == pytest.approx(0.4)
    assert chosen({1.0: 0.2}, preferred=-1.0) == 1.0
    assert chosen({-1.0: 0.2}, preferred=1.0) == -1.0


def test_of_equally_good_actions_the_nearest_to_the_preferred_one_is_taken():
    probabilities = {-0.8: 0.86, 0.2: 0.88, 0.8: 0.9}
    assert chosen(probabilities, preferred=-1.0) == pytest.approx(-0.8)
    assert chosen(probabilities, preferred=0.12) == pytest.approx(0.2)
    assert chosen(probabilities, preferred=0.8) == pytest.approx(0.8)
    assert chosen(probabilities, preferred=-1.0, tolerance=0.03) == pytest.approx(
        0.2
    )  # 0.86 is no longer equally good.
    assert chosen(probabilities, preferred=-1.0, tolerance=0.0) == pytest.approx(0.8)


def test_of_two_equally_near_actions_the_one_that_opens_more_is_taken():
    for action in GRID[26:]:  # For any last bits of the numbers of the grid.
        assert chosen({-action: 0.9, action: 0.9}, preferred=0.0) == pytest.approx(-action)


def test_a_flat_curve_gives_the_preferred_action():
    for preferred in GRID:
        assert choose(curves({}, elsewhere=0.5), np.array([preferred]), 0.05)[0] == preferred
        assert choose(curves({1.0: 0.52, -1.0: 0.48}, elsewhere=0.5), np.array([preferred]), 0.05)[0] == preferred


def test_with_flat_curves_a_far_hand_opens_and_a_near_hand_continues():
    omega = agent(0.4)
    near, mixed = states(0.05, 0.05, 0.05), states(0.11, 0.09, 0.5)
    np.testing.assert_allclose(omega.act(near), 0.4)
    omega._model = fixed_success_model.model(0.4, slope=0.0)  # From now on all curves are flat.
    np.testing.assert_allclose(omega.act(mixed)[:, 0], [-1.0, 0.4, -1.0])
    np.testing.assert_allclose(omega.act(near)[:, 0], [-1.0, 0.4, -1.0])


def test_a_clearly_best_action_is_taken_at_any_distance():
    np.testing.assert_allclose(agent(0.4).act(states(0.05, 0.11, 0.5)), 0.4)


def test_every_episode_has_its_own_memory_and_starts_empty():
    omega, near = agent(0.4), states(0.05, 0.05, 0.05)
    np.testing.assert_allclose(omega.act(near), 0.4)
    omega._model = fixed_success_model.model(0.4, slope=0.0)
    omega.reset(np.array([1]))
    np.testing.assert_allclose(omega.act(near)[:, 0], [0.4, -1.0, 0.4])


def test_changing_returned_actions_does_not_change_the_agent():
    omega, near = agent(0.4), states(0.05, 0.05, 0.05)
    omega.act(near)[:] = 7.0
    omega._model = fixed_success_model.model(0.4, slope=0.0)
    np.testing.assert_allclose(omega.act(near), 0.4)


def test_actions_are_equal_at_any_batch_size():
    rng = np.random.default_rng(0)
    noisy = {
        name: array + 0.1 * rng.normal(size=array.shape) for name, array in fixed_success_model.arrays(0.4, 1.0).items()
    }
    model, steps = SuccessModel(noisy | {"deviation": np.ones(48)}), rng.normal(size=(5, 40, 48))
    together, alone = OmegaAgent(model, 0.01, 1.0), [OmegaAgent(model, 0.01, 1.0) for _ in range(40)]
    for rows in steps:
        actions = together.act(rows)
        assert len(np.unique(actions)) > 3
        np.testing.assert_array_equal(actions, np.concatenate([one.act(rows[[k]]) for k, one in enumerate(alone)]))


def test_the_settings_name_the_model_and_another_model_is_refused(tmp_path: Path):
    file = fixed_success_model.write(tmp_path / "model.safetensors", 0.4)
    omega = Omega(model=str(file)).for_source("real")
    assert omega == Omega(model=str(file), sha256=hashing.sha256(file))
    again = registry.create("omega", registry.settings_of(omega))
    assert again == omega
    np.testing.assert_allclose(omega.agent(0).act(states(0.05)), 0.4)
    fixed_success_model.write(file, -0.4)
    with pytest.raises(BadInput, match=f"has the SHA-256 {hashing.sha256(file)}, not {omega.sha256}"):
        omega.agent(0)


def test_settings_that_are_not_possible_raise(tmp_path: Path):
    with pytest.raises(BadInput, match=r"ships for minjerk reaches.*--model takes the file"):
        Omega().for_source("minjerk")
    with pytest.raises(BadInput, match="No such file"):
        Omega(model=str(tmp_path / "none.safetensors")).for_source("real")
    with pytest.raises(BadInput, match=r"takes the file of a model .* or one of real, synthetic.*'nofile'"):
        Omega(model="nofile").for_source("real")
    with pytest.raises(BadInput, match="--tolerance is 2; a difference of probabilities lies between 0 and 1"):
        Omega(tolerance=2.0)
    with pytest.raises(BadInput, match="--near is -1"):
        Omega(near=-1.0)


def test_a_method_is_created_for_the_reaches_of_its_run(tmp_path: Path):
    file = fixed_success_model.write(tmp_path / "model.safetensors", 0.4)
    omega = registry.create("omega", {"model": str(file)}, "real")
    assert registry.settings_of(omega)["sha256"] == hashing.sha256(file)
    assert registry.create("exp", {}, "real") == registry.create("exp")
    with pytest.raises(registry.BadSettings, match="'omega': there is no success model"):
        registry.create("omega", {}, "minjerk")


@pytest.mark.slow
def test_from_the_command_line(tiny_world: Path, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]):
    words = ["run", "--method", "omega", "--split", "test", "--quiet", "--record", "0"]
    assert "no success model ships for minjerk reaches" in complaint(*words, "--reaches", "minjerk")
    assert not (tiny_world / "runs").exists()
    file = fixed_success_model.write(tiny_world / "model.safetensors", 0.4)
    assert main.main([*words, "--model", "model.safetensors", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["method"] == "omega"
    config = json.loads((tiny_world / "runs/omega/synthetic/seed0/config.json").read_text())
    assert config["settings"] == registry.settings_of(Omega(model="model.safetensors", sha256=hashing.sha256(file)))
    fixed_success_model.write(file, -0.4)
    assert "holds another run: it differs in settings" in complaint(*words, "--model", "model.safetensors")
    assert "has no weights" in complaint("eval", "--method", "omega", "--model", "model.safetensors")
