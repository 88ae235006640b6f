"""The contract of every environment with the programs of others: wrappers, vectors, collectors, checkers, specs."""

from __future__ import annotations

import copy
import pickle
import unittest
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from dm_env import test_utils
from gymnasium import wrappers
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import vector as vector_wrappers

import dextron_bench
from dextron_bench.reaches.setting import plain
from dextron_bench.reaches.sources import open_source
from tests.helpers import abilities
from tests.helpers.short_reaches import SETTINGS, SOURCE

ID = "dextron_bench/Grasp-v0"
MINJERK = [open_source("minjerk").sample(np.random.default_rng(k)) for k in range(2)]
VARIANTS: dict[str, dict[str, Any]] = {
    "drawn": {"reaches": SOURCE},
    "listed": {"reaches": SOURCE, "settings": SETTINGS[:2]},
    "pictured": {"reaches": SOURCE, "settings": SETTINGS[:2], "render_mode": "rgb_array"},
}
MODES = ("vector_entry_point", "sync", "async")
STEPS = 4

SINGLE: dict[str, Callable[[gymnasium.Env], gymnasium.Env]] = {
    "RescaleAction": lambda env: wrappers.RescaleAction(env, np.float32(-0.3), np.float32(0.7)),
    "RescaleAction 64": lambda env: wrappers.RescaleAction(env, np.float64(-3.1), np.float64(0.7)),
    "ClipAction": wrappers.ClipAction,
    "TransformAction": lambda env: wrappers.TransformAction(env, np.asarray, env.action_space),
    "StickyAction": lambda env: wrappers.StickyAction(env, 0.5),
    "NormalizeObservation": wrappers.NormalizeObservation,
    "NormalizeReward": wrappers.NormalizeReward,
    "TimeAwareObservation": wrappers.TimeAwareObservation,
    "RecordEpisodeStatistics": wrappers.RecordEpisodeStatistics,
    "FrameStackObservation": lambda env: wrappers.FrameStackObservation(env, 3),
    "DelayObservation": lambda env: wrappers.DelayObservation(env, 2),
    "MaxAndSkipObservation": lambda env: wrappers.MaxAndSkipObservation(env, 2),
    "DtypeObservation": lambda env: wrappers.DtypeObservation(env, np.float32),
    "RescaleObservation": lambda env: wrappers.RescaleObservation(env, np.float64(-1.0), np.float64(1.0)),
    "TransformObservation": lambda env: wrappers.TransformObservation(env, np.copy, env.observation_space),
    "FlattenObservation": wrappers.FlattenObservation,
    "TransformReward": lambda env: wrappers.TransformReward(env, float),
    "TimeLimit": lambda env: wrappers.TimeLimit(env, 3),
    "OrderEnforcing": wrappers.OrderEnforcing,
    "PassiveEnvChecker": wrappers.PassiveEnvChecker,
    "Autoreset": wrappers.Autoreset,
}
PICTURED: dict[str, Callable[[gymnasium.Env], gymnasium.Env]] = {
    "AddRenderObservation": wrappers.AddRenderObservation,
    "RenderCollection": wrappers.RenderCollection,
}
VECTOR: dict[str, Callable[[Any], VectorEnv]] = {
    "RescaleAction": lambda env: vector_wrappers.RescaleAction(env, np.full(1, -0.3, "f4"), np.full(1, 0.7, "f4")),
    "ClipAction": vector_wrappers.ClipAction,
    "NormalizeObservation": vector_wrappers.NormalizeObservation,
    "NormalizeReward": vector_wrappers.NormalizeReward,
    "RecordEpisodeStatistics": vector_wrappers.RecordEpisodeStatistics,
    "DtypeObservation": lambda env: vector_wrappers.DtypeObservation(env, np.float32),
    "FlattenObservation": vector_wrappers.FlattenObservation,
    "TransformReward": lambda env: vector_wrappers.TransformReward(env, np.abs),
    "DictInfoToList": vector_wrappers.DictInfoToList,
}


@pytest.fixture(autouse=True)
def strict() -> Iterator[None]:
    """Any warning of Gymnasium or of a checker is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ResourceWarning)  # Of temporary folders of Minari.
        warnings.filterwarnings(
            "ignore", message=".*(Overwriting existing videos|recommend using np.float32|in cast|precision lowered).*"
        )
        yield


def played_steps(env: Any) -> list[Any]:
    """What a reset and some random steps return."""
    returned: list[Any] = [env.reset(seed=1)]
    env.action_space.seed(1)
    returned.extend(env.step(env.action_space.sample()) for _ in range(STEPS))
    return returned


def leaves(info: Any) -> Iterator[Any]:
    """All values of an info."""
    if isinstance(info, dict):
        for value in info.values():
            yield from leaves(value)
    elif isinstance(info, list):
        for value in info:
            yield from leaves(value)
    else:
        yield info


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("wrapper", SINGLE)
def test_a_single_environment_works_in_gymnasiums_wrappers(variant: str, wrapper: str):
    env = SINGLE[wrapper](gymnasium.make(ID, **VARIANTS[variant]))
    infos = [returned[-1] for returned in played_steps(env)]
    env.close()
    assert all(isinstance(value, str | float | bool) for info in infos for value in leaves(info))


@pytest.mark.slow
@pytest.mark.parametrize("wrapper", PICTURED)
def test_a_single_environment_gives_pictures_to_gymnasiums_wrappers(wrapper: str):
    env = PICTURED[wrapper](gymnasium.make(ID, **VARIANTS["pictured"]))
    played_steps(env)
    picture = np.asarray(env.render())
    env.close()
    assert picture.shape[-3:] == (360, 480, 3)


def test_gymnasium_records_a_video_of_singles_and_vectors(tmp_path: Path):
    pytest.importorskip("moviepy", reason="RecordVideo needs MoviePy")
    warnings.simplefilter("ignore")  # MoviePy's own.
    with wrappers.RecordVideo(gymnasium.make(ID, **VARIANTS["pictured"]), str(tmp_path / "one")) as env:
        played_steps(env)
    vector = gymnasium.make_vec(ID, 2, **VARIANTS["pictured"])
    vector_env = vector_wrappers.RecordVideo(vector, str(tmp_path / "many"), video_length=2)
    played_steps(vector_env)
    vector_env.close()
    assert list(tmp_path.glob("one/*.mp4"))
    assert list(tmp_path.glob("many/*.mp4"))


@pytest.mark.slow
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("mode", MODES)
def test_a_vector_environment_works_in_every_mode(variant: str, mode: str):
    if variant == "pictured" and not abilities.can_draw():  # A worker of `async` says so on stderr alone.
        pytest.skip(abilities.NO_PICTURES)
    context = {"context": "spawn"} if (mode, variant) == ("async", "pictured") else {}  # A fork cannot draw.
    env = gymnasium.make_vec(ID, 2, vectorization_mode=mode, vector_kwargs=context, **VARIANTS[variant])
    try:
        _, info = played_steps(env)[-1][::4]
        assert info["setting"]["offset_x"].shape == info["episode_return"].shape == (2,)
        assert info["failure"].tolist() == ["", ""]
        if variant == "pictured":
            pictures: Any = env.render()
            assert np.shape(pictures) == (2, 360, 480, 3)
    finally:
        env.close()


@pytest.mark.parametrize("mode", MODES[:2])
@pytest.mark.parametrize("wrapper", VECTOR)
def test_a_vector_environment_works_in_gymnasiums_wrappers(mode: str, wrapper: str):
    env = VECTOR[wrapper](gymnasium.make_vec(ID, 2, vectorization_mode=mode, **VARIANTS["listed"]))
    played_steps(env)
    env.close()


@pytest.mark.parametrize("variant", VARIANTS)
def test_the_environment_passes_the_checkers_of_gymnasium_and_stable_baselines(variant: str):
    sb3 = pytest.importorskip("stable_baselines3.common.env_checker")
    check_env(gymnasium.make(ID, **VARIANTS[variant]).unwrapped)
    sb3.check_env(gymnasium.make(ID, **VARIANTS[variant]), skip_render_check=False)


@pytest.mark.parametrize("variant", VARIANTS)
def test_vectors_of_stable_baselines_play_the_environment(variant: str):
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    monitor = pytest.importorskip("stable_baselines3.common.monitor")

    def make() -> gymnasium.Env:
        return monitor.Monitor(gymnasium.make(ID, **VARIANTS[variant]), info_keywords=("is_success", "failure"))

    for env in (vec_env.DummyVecEnv([make] * 2), vec_env.SubprocVecEnv([make] * 2, start_method="fork")):
        env = vec_env.VecNormalize(vec_env.VecFrameStack(env, 2))
        env.reset()
        infos = [env.step(np.zeros((2, 1), np.float32))[-1] for _ in range(STEPS)]
        assert [info["failure"] for info in infos[-1]] == ["", ""]
        env.close()


@pytest.mark.parametrize("record_infos", [False, True])
def test_minaris_collector_stores_whole_episodes_with_infos(
    record_infos: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    minari = pytest.importorskip("minari")
    pytest.importorskip("jax", reason="Minari's collector needs JAX")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    settings = {"reaches": "minjerk", "settings": MINJERK}
    env = minari.DataCollector(gymnasium.make(ID, **settings), record_infos=record_infos, data_format="arrow")
    env.reset(seed=2**64 - 1, options={"setting": plain(MINJERK[1])})
    total = 0
    for _ in range(STEPS):
        total += 1
        env.step(np.array([0.5]))
    env.reset()
    env.step(np.array([0.5]))
    data = env.create_dataset(
        "dextron/collected-v0",
        algorithm_name="none",
        author="a",
        author_email="b",
        code_permalink="c",
        description="d",
        eval_env=ID,
    )
    env.close()
    episode = data[0]
    assert len(episode.rewards) == total
    if record_infos:
        stored = episode.infos["setting"]  # Minari 0.5 reads its Arrow format as an array of dictionaries.
        assert (stored[0]["reach"] if isinstance(stored, np.ndarray) else stored["reach"][0]) == MINJERK[1].reach
        assert episode.infos["failure"][-1] == ""
    recovered = data.recover_environment()
    assert recovered.reset()[1]["setting"] == plain(MINJERK[0])


def test_an_environment_survives_its_spec_as_an_object_and_as_json():
    env = wrappers.TimeAwareObservation(gymnasium.make(ID, reaches="minjerk", settings=MINJERK))
    assert env.spec is not None
    expected = played_steps(env)
    for spec in (env.spec, EnvSpec.from_json(env.spec.to_json()), pickle.loads(pickle.dumps(env.spec))):
        assert str(played_steps(gymnasium.make(spec))) == str(expected)
    assert str(played_steps(copy.deepcopy(env))) == str(expected)


@pytest.mark.parametrize("mode", MODES)
def test_a_vector_environment_survives_its_spec(mode: str):
    env = gymnasium.make_vec(ID, 2, vectorization_mode=mode, reaches="minjerk", settings=MINJERK)
    assert env.spec is not None
    expected = played_steps(env)
    for spec in (env.spec, EnvSpec.from_json(env.spec.to_json())):
        other = gymnasium.make_vec(spec)
        assert str(played_steps(other)) == str(expected)
        other.close()
    env.close()


class TestDmControl(test_utils.EnvironmentTestMixin, unittest.TestCase):
    """dm_env's own contract."""

    def make_object_under_test(self, **_: Any) -> Any:
        """The environment that the tests of the mixin use."""
        return dextron_bench.load_environment(SOURCE, seed=1)
