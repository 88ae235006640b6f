"""Bottles: each simulation has the physics of a model that is compiled with its bottle, to the last bit."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pandas as pd
import pytest

from dextron_bench.reaches.sources import open_source
from dextron_bench.splits.loading import load_split
from dextron_bench.world import model
from dextron_bench.world.bottle import Bottle, from_frame
from dextron_bench.world.bottles import model_bottle
from dextron_bench.world.engine import Engine

HEAVY, SLIPPERY, WIDE = Bottle(0.9, 1.0, 0.025), Bottle(0.3, 0.6, 0.025), Bottle(model_bottle().mass, 1.0, 0.031)
PATH = min(  # A quick reach, which comes to the bottle while the hand closes.
    map(open_source("synthetic").path, (case.setting for case in load_split("synthetic", "test").cases[:100])),
    key=lambda path: len(path.positions),
)
OPENING = 60  # Control steps before the hand closes.


def play(engine: Engine, bottles: list[Bottle], count: int, steps: int = 120) -> np.ndarray:
    """States (steps + 1, count, 48) of a hand that opens and then closes."""
    slots = np.arange(count)
    states = [engine.begin(slots, [PATH] * count, bottles)]
    for step in range(steps):
        actions = np.full((count, 1), -1.0 if step < OPENING else 1.0)
        states.append(engine.step(slots, actions).states)
    return np.array(states)


def compiled(bottle: Bottle) -> mujoco.MjModel:
    """The model whose source has the bottle."""
    source = re.sub(
        r'<geom name="bottle"[^>]*/>',
        f'<geom name="bottle" type="cylinder" size="{bottle.radius!r} 0.125" mass="{bottle.mass!r}"/>',
        model.mjcf(),
    )
    loaded = mujoco.MjModel.from_xml_string(source)
    loaded.geom_friction[:, 0] = bottle.friction
    return loaded


@pytest.mark.slow
@pytest.mark.parametrize("bottle", [HEAVY, SLIPPERY, WIDE], ids=["heavy", "slippery", "wide"])
def test_a_bottle_has_the_physics_of_a_model_compiled_with_it(bottle: Bottle, monkeypatch: pytest.MonkeyPatch):
    states = play(Engine(3, threads=1), [HEAVY, bottle, SLIPPERY], 3)
    other = compiled(bottle)
    monkeypatch.setattr(model, "load", lambda: other)
    assert np.array_equal(states[:, 1], play(Engine(1, threads=1), [], 1)[:, 0])


def test_bottles_differ_and_the_model_s_bottle_changes_no_bit():
    engine = Engine(3, threads=1)
    states, plain = play(engine, [model_bottle(), HEAVY, WIDE], 3), play(Engine(1, threads=1), [], 1)
    assert np.array_equal(states[:, 0], plain[:, 0])
    assert not np.array_equal(states[:, 1], plain[:, 0])
    assert not np.array_equal(states[:, 2], plain[:, 0])
    assert np.array_equal(play(engine, [], 3)[:, 2], plain[:, 0])  # The next episode has the model's bottle again.


def test_a_fork_has_the_bottle_of_its_source():
    engine, steps = Engine(2, threads=1), 90
    whole = play(engine, [HEAVY], 1, steps + 30)
    play(engine, [HEAVY, WIDE], 2, steps)
    engine.fork(np.array([0]), np.array([1]))
    forked = [engine.step(np.array([1]), np.ones((1, 1))).states[0] for _ in range(30)]
    assert np.array_equal(forked, whole[steps + 1 :, 0])


def test_the_model_s_bottle_is_as_the_paper_s():
    bottle = model_bottle()
    assert bottle.mass == pytest.approx(1000.0 * np.pi * 0.025**2 * 0.25)  # 0.491 kg of water.
    assert (bottle.friction, bottle.radius) == (1.0, 0.025)


def test_a_table_without_their_columns_has_no_bottles():
    rows = pd.DataFrame({"reach": ["a", "b"]})
    assert from_frame(rows) == []
    assert from_frame(rows.assign(mass=0.9, friction=1.0, radius=0.025)) == [HEAVY] * 2
