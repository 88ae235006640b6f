"""OMEGA: which action it takes of curves made by hand, and with which model it acts."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from baselines.omega import BadRule, NoModel, Omega, OmegaAgent, choose
from dextron_bench.cli import main
from dextron_bench.methods import registry
from dextron_bench.storage import hashing
from dextron_bench.success.network import GRID, SuccessModel
from tests.helpers import fixed_success_model, tiny_benchmark


def curves(*points: dict[float, float], elsewhere: float = 0.1) -> np.ndarray:
    """Curves (N, 51) with these chances at these actions, and another everywhere else."""
    found = np.full((len(points), len(GRID)), elsewhere)
    for row, chances in zip(found, points, strict=True):
        for action, chance in chances.items():
            row[np.abs(GRID - action).argmin()] = chance
    return found


def chosen(chances: dict[float, float], wanted: float, tolerance: float = 0.05) -> float:
    return float(choose(curves(chances), np.array([wanted]), tolerance)[0])


def states(*distances: float) -> np.ndarray:
    """States (N, 48) of upright hands whose palm centre is so far from the bottle's axis [m]."""
    found = np.zeros((len(distances), 48))
    found[:, [3, 10]] = 1.0
    found[:, 7], found[:, 8] = distances, -0.09  # The palm centre is 0.09 m ahead of the palm.
    return found


def agent(likes: float, slope: float = 8.0, tolerance: float = 0.02) -> OmegaAgent:
    """With a made-up model, for three episodes."""
    made = OmegaAgent(fixed_success_model.model(likes, slope), tolerance, near=0.1)
    made.reset(np.arange(3))
    return made


def test_the_best_action_is_taken():
    assert chosen({0.4: 0.9, -0.6: 0.7}, wanted=-1.0) == pytest.approx(0.4)
    assert chosen({1.0: 0.2}, wanted=-1.0) == 1.0
    assert chosen({-1.0: 0.2}, wanted=1.0) == -1.0


def test_of_actions_about_as_good_the_nearest_to_the_wanted():
    chances = {-0.8: 0.86, 0.2: 0.88, 0.8: 0.9}
    assert chosen(chances, wanted=-1.0) == pytest.approx(-0.8)
    assert chosen(chances, wanted=0.12) == pytest.approx(0.2)
    assert chosen(chances, wanted=0.8) == pytest.approx(0.8)
    assert chosen(chances, wanted=-1.0, tolerance=0.03) == pytest.approx(0.2)  # 0.86 is no longer about as good.
    assert chosen(chances, wanted=-1.0, tolerance=0.0) == pytest.approx(0.8)


def test_of_two_as_near_the_one_that_opens_more():
    for away in GRID[26:]:  # Whatever the last bits of the grid's numbers.
        assert chosen({-away: 0.9, away: 0.9}, wanted=0.0) == pytest.approx(-away)


def test_a_flat_curve_says_nothing_and_what_is_wanted_is_done():
    for wanted in GRID:
        assert choose(curves({}, elsewhere=0.5), np.array([wanted]), 0.05)[0] == wanted
        assert choose(curves({1.0: 0.52, -1.0: 0.48}, elsewhere=0.5), np.array([wanted]), 0.05)[0] == wanted


def test_a_hand_far_away_opens_and_a_near_one_goes_on_where_the_model_says_nothing():
    made = agent(0.4)
    near, apart = states(0.05, 0.05, 0.05), states(0.11, 0.09, 0.5)
    np.testing.assert_allclose(made.act(near), 0.4)
    made._model = fixed_success_model.model(0.4, slope=0.0)  # From now on it says nothing.
    np.testing.assert_allclose(made.act(apart)[:, 0], [-1.0, 0.4, -1.0])
    np.testing.assert_allclose(made.act(near)[:, 0], [-1.0, 0.4, -1.0])


def test_what_the_model_says_clearly_is_done_at_any_distance():
    np.testing.assert_allclose(agent(0.4).act(states(0.05, 0.11, 0.5)), 0.4)


def test_every_episode_has_its_own_memory_and_begins_without_one():
    made, near = agent(0.4), states(0.05, 0.05, 0.05)
    np.testing.assert_allclose(made.act(near), 0.4)
    made._model = fixed_success_model.model(0.4, slope=0.0)
    made.reset(np.array([1]))
    np.testing.assert_allclose(made.act(near)[:, 0], [0.4, -1.0, 0.4])


def test_an_agents_actions_are_its_own():
    made, near = agent(0.4), states(0.05, 0.05, 0.05)
    made.act(near)[:] = 7.0
    made._model = fixed_success_model.model(0.4, slope=0.0)
    np.testing.assert_allclose(made.act(near), 0.4)


def test_it_acts_the_same_at_any_batch_size():
    rng = np.random.default_rng(0)
    rough = {
        name: array + 0.1 * rng.normal(size=array.shape) for name, array in fixed_success_model.arrays(0.4, 1.0).items()
    }
    model, shown = SuccessModel(rough | {"deviation": np.ones(48)}), rng.normal(size=(5, 40, 48))
    together, alone = OmegaAgent(model, 0.01, 1.0), [OmegaAgent(model, 0.01, 1.0) for _ in range(40)]
    for now in shown:
        actions = together.act(now)
        assert len(np.unique(actions)) > 3
        np.testing.assert_array_equal(actions, np.concatenate([one.act(now[[k]]) for k, one in enumerate(alone)]))


def test_it_says_which_model_it_acts_with_and_refuses_another(tmp_path: Path):
    file = fixed_success_model.write(tmp_path / "model.safetensors", 0.4)
    made = Omega(model=str(file)).for_source("real")
    assert made == Omega(model=str(file), sha256=hashing.sha256(file))
    again = registry.create("omega", registry.settings_of(made))
    assert again == made
    np.testing.assert_allclose(made.agent(0).act(states(0.05)), 0.4)
    fixed_success_model.write(file, -0.4)
    with pytest.raises(NoModel, match=f"has the SHA-256 {hashing.sha256(file)}, not {made.sha256}"):
        made.agent(0)


def test_what_it_cannot_act_with_is_told(tmp_path: Path):
    with pytest.raises(NoModel, match=r"ships for minjerk reaches.*--model takes the file"):
        Omega().for_source("minjerk")
    with pytest.raises(NoModel, match="No such file"):
        Omega(model=str(tmp_path / "none.safetensors")).for_source("real")
    with pytest.raises(NoModel, match=r"takes the file of a model .* or one of real, synthetic.*'nofile'"):
        Omega(model="nofile").for_source("real")
    with pytest.raises(BadRule, match="--tolerance is 2; a difference of probabilities lies between 0 and 1"):
        Omega(tolerance=2.0)
    with pytest.raises(BadRule, match="--near is -1"):
        Omega(near=-1.0)


def test_a_method_is_made_for_the_reaches_of_its_run(tmp_path: Path):
    file = fixed_success_model.write(tmp_path / "model.safetensors", 0.4)
    made = registry.create("omega", {"model": str(file)}, "real")
    assert registry.settings_of(made)["sha256"] == hashing.sha256(file)
    assert registry.create("exp", {}, "real") == registry.create("exp")
    with pytest.raises(registry.BadSettings, match="'omega': there is no success model"):
        registry.create("omega", {}, "minjerk")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty working folder, with tiny splits of short reaches as the shipped ones."""
    tiny_benchmark.install(tiny_benchmark.write(tmp_path / "data"), monkeypatch.setattr)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    tiny_benchmark.forget()


def test_from_the_command_line(here: Path, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]):
    words = ["run", "--method", "omega", "--split", "test", "--no-floors", "--quiet", "--record", "0"]
    told = complaint(*words, "--reaches", "minjerk")
    assert "no success model ships for minjerk reaches" in told
    assert not (here / "runs").exists()
    file = fixed_success_model.write(here / "model.safetensors", 0.4)
    assert main.main([*words, "--model", "model.safetensors", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0]["method"] == "omega"
    config = json.loads((here / "runs/omega/synthetic/seed0/config.json").read_text())
    assert config["settings"] == registry.settings_of(Omega(model="model.safetensors", sha256=hashing.sha256(file)))
    fixed_success_model.write(file, -0.4)
    assert "holds another run: it differs in settings" in complaint(*words, "--model", "model.safetensors")
    assert "has no weights" in complaint("eval", "--method", "omega", "--model", "model.safetensors")
