"""Minari data sets: Minari loads the played episodes exactly, and a policy can learn from them."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from baselines.floors import Nothing
from dextron_bench.cli import main
from dextron_bench.evaluation import minari_export
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts.policies import Case, Expert, ExpertAgent
from dextron_bench.reaches.setting import Setting
from dextron_bench.splits.loading import Split
from dextron_bench.storage import hashing
from dextron_bench.world.gym import GraspEnv
from tests.helpers.short_reaches import SETTINGS, SOURCE

minari = pytest.importorskip("minari", reason="Minari is not installed: pip install -e '.[minari]'")

CASES = tuple(Case(setting, Expert(1.2, 0.3), 0.1) for setting in SETTINGS[:3])
SPLIT = Split(name="train", reaches="synthetic", digest="5a5a", cases=CASES)
EXPERT, STILL = (
    minari_export.Player("expert", ExpertAgent()),
    minari_export.Player("nothing", Nothing().agent(0), {"sha256": "0f"}),
)
NAME = "dextron/brief-v0"


def write(into: Path, players: list[minari_export.Player], split: Split = SPLIT, rows: int = 3, **options):
    """Exports episodes on short reaches, and loads them with Minari."""
    return minari.MinariDataset(
        minari_export.Export(NAME, split, rows, players).write(SOURCE, into, **options) / "data"
    )


def test_minari_loads_the_played_episodes_bit_for_bit(tmp_path: Path):
    loaded = write(tmp_path, [EXPERT, STILL], rows=2)
    played = [episode for player in (EXPERT, STILL) for _, episode in sorted(dict(play(player, 2)).items())]
    assert loaded.total_episodes == len(played) == 4
    assert loaded.total_steps == sum(len(episode.actions) for episode in played)
    for stored, episode in zip(loaded.iterate_episodes(), played, strict=True):
        for loaded_array, array in (
            (stored.observations, episode.states),
            (stored.actions, episode.actions),
            (stored.rewards, episode.rewards),
        ):
            assert loaded_array.dtype == np.float64
            np.testing.assert_array_equal(loaded_array, array)
        assert (stored.terminations[-1], stored.truncations[-1]) == (episode.terminated, episode.truncated)
        assert not stored.terminations[:-1].any()
        assert not stored.truncations[:-1].any()


def play(player: minari_export.Player, rows: int):
    return rollout(player.agent, SOURCE, CASES[:rows], threads=1)


def test_the_metadata_of_an_episode_is_enough_to_replay_it(tmp_path: Path):
    loaded = write(tmp_path, [EXPERT])
    for stored, metadata in zip(loaded, loaded.storage.get_episode_metadata(range(3)), strict=True):
        env = GraspEnv(SOURCE)
        env.reset(options={"setting": Setting(**metadata["setting"])})
        steps = [env.step(action) for action in stored.actions]
        np.testing.assert_array_equal([step[0] for step in steps], stored.observations[1:])
        assert metadata["return"] == stored.rewards.sum()
        assert metadata["is_success"] == (metadata["return"] == 20.0)
        assert (metadata["player"], metadata["row"]) == ("expert", stored.id)


def test_the_data_set_has_split_players_and_provenance(tmp_path: Path):
    loaded = write(tmp_path, [EXPERT, STILL])
    about = loaded.storage.metadata
    assert about["dextron_bench"]["split"] == {"reaches": "synthetic", "name": "train", "digest": "5a5a", "rows": 3}
    assert about["dextron_bench"]["players"] == [{"name": "expert"}, {"name": "nothing", "sha256": "0f"}]
    assert about["dextron_bench"]["provenance"]["versions"]["mujoco"]
    assert about["author"] == {minari_export.CONTRIBUTORS}
    assert about["algorithm_name"] == "expert, nothing"
    assert about["dataset_size"] > 0.1  # Megabytes.
    assert loaded.id == NAME
    assert loaded.env_spec.kwargs == {"reaches": "synthetic"}
    env = loaded.recover_environment()
    assert isinstance(env.unwrapped, GraspEnv)
    assert env.observation_space == loaded.observation_space


def test_minari_finds_the_data_set_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write(tmp_path, [STILL], rows=1)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    assert minari.load_dataset(NAME).total_episodes == 1
    assert NAME in minari.list_local_datasets()


def test_nothing_else_is_written_and_threads_change_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("MINARI_DATASETS_PATH", raising=False)
    write(tmp_path / "a", [EXPERT], threads=1)
    write(tmp_path / "b", [EXPERT], threads=2)
    assert sorted(folder.name for folder in tmp_path.iterdir()) == ["a", "b"]
    assert [folder.name for folder in (tmp_path / "a" / "dextron").iterdir()] == ["brief-v0"]
    files = [file for file in (tmp_path / "a").rglob("*.*") if file.is_file() and file.parent.name != "data"]
    assert len(files) == 6  # Two files for each episode: arrays and metadata.
    assert all(file.read_bytes() == (tmp_path / "b" / file.relative_to(tmp_path / "a")).read_bytes() for file in files)


def test_a_failed_export_raises_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class SendsNan(ExpertAgent):
        def act(self, states: np.ndarray) -> np.ndarray:
            return np.full((len(states), 1), np.nan)

    with pytest.raises(minari_export.BadExport, match=r"nan failed in row 0 of 'train': action is nan"):
        write(tmp_path, [minari_export.Player("nan", SendsNan())])
    assert not list(tmp_path.rglob("*brief*"))
    write(tmp_path, [STILL], rows=1)
    with pytest.raises(minari_export.BadExport, match="already exists; remove it, or choose another --name"):
        write(tmp_path, [STILL], rows=1)
    for name in ("../up-v0", "brief", "a b-v0", "/brief-v0"):
        with pytest.raises(minari_export.BadExport, match="names no data set"):
            minari_export.Export(name, SPLIT, 1, [STILL])
    with pytest.raises(minari_export.BadExport, match="at least one row"):
        minari_export.Export(NAME, SPLIT, 0, [STILL])
    monkeypatch.setitem(sys.modules, "minari.dataset.minari_storage", None)
    with pytest.raises(minari_export.MissingMinari, match="pip install"):
        write(tmp_path / "b", [STILL])


@pytest.mark.slow
def test_a_policy_learned_from_the_data_set_beats_the_mean_action_on_other_episodes(tmp_path: Path):
    rng = np.random.default_rng(0)
    cases = tuple(Case(SOURCE.sample(rng), Expert(1.2, 0.4), 0.0) for _ in range(20))
    loaded = write(tmp_path, [EXPERT], replace(SPLIT, cases=cases), len(cases))
    train, held_out = minari.split_dataset(loaded, sizes=[15, 5], seed=0)
    (x, y), (test_x, test_y) = transitions(train), transitions(held_out)
    mean, deviation = x.mean(0), x.std(0) + 1e-6
    policy = fit((x - mean) / deviation, y)
    with torch.no_grad():
        error = (policy((test_x - mean) / deviation) - test_y).square().mean().item()
    constant = (y.mean() - test_y).square().mean().item()
    assert error < 0.4 * constant


def transitions(loaded) -> tuple[torch.Tensor, torch.Tensor]:
    """States (N, 48) and actions (N, 1) of all episodes."""
    episodes = list(loaded.iterate_episodes())
    states = np.concatenate([episode.observations[:-1] for episode in episodes])
    actions = np.concatenate([episode.actions for episode in episodes])
    return torch.tensor(states).float(), torch.tensor(actions).float()


def fit(x: torch.Tensor, y: torch.Tensor) -> torch.nn.Module:
    """A small policy, trained for 300 steps of Adam."""
    torch.manual_seed(0)
    policy = torch.nn.Sequential(torch.nn.Linear(48, 32), torch.nn.Tanh(), torch.nn.Linear(32, 1))
    adam = torch.optim.Adam(policy.parameters(), lr=3e-3)
    for _ in range(300):
        batch = torch.randint(len(x), (256,))
        loss = (policy(x[batch]) - y[batch]).square().mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
    return policy


@pytest.fixture
def here(training_world: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder with the tiny benchmark installed."""
    monkeypatch.setattr("baselines.bc.STEPS", 2)
    return training_world


@pytest.mark.slow
def test_from_the_command_line(here: Path, capsys: pytest.CaptureFixture[str], complaint: Callable[..., str]):
    words = ["data", "export", "--into", "sets", "--split", "test"]
    assert main.main([*words, "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["name"], summary["episodes"], summary["solved"]) == ("dextron/synthetic-test-experts-v0", 2, 2)
    assert summary["folder"] == "sets/dextron/synthetic-test-experts-v0"
    assert "already exists" in complaint(*words)
    assert "no data set" in complaint(*words, "--name", "mine")
    run = ["run", "--method", "bc", "--preset", "smoke", "--split", "test", "--quiet", "--record", "0"]
    assert main.main(run) == 0
    weights = "runs/bc-smoke/synthetic/seed0/weights.safetensors"
    assert main.main([*words, "--policies", weights, "--rows", "1", "--author", "A. Person"]) == 0
    about = minari.MinariDataset("sets/dextron/synthetic-test-policies-v0/data").storage.metadata
    assert about["author"] == {"A. Person"}
    assert about["dextron_bench"]["players"][0]["sha256"] == hashing.sha256(here / weights)
    assert about["dextron_bench"]["split"]["rows"] == 1
