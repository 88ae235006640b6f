"""How much of bare MuJoCo's speed is left when the benchmark's own work is added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from mujoco.batch import Batch
from pytest_benchmark.fixture import BenchmarkFixture

from dextron_bench.evaluation import episodes
from dextron_bench.evaluation import rollout as evaluation_rollout
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import policies
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches.reach import Path
from dextron_bench.world import model
from dextron_bench.world.engine import Engine, Step
from tests.benchmarks.measure import Row, alone, in_turns, note, scaled
from tests.benchmarks.workload import Prepared, cases, reaches

EPISODES, SLOTS, ROUNDS = 192, 96, 3
INPUTS = ("ctrl", "mocap_pos", "mocap_quat")


@dataclass
class Tape:
    """All that goes into a batch: rows of begun episodes by slot, and each step's slots with their inputs."""

    slots: int = 0
    events: list[tuple[np.ndarray, list[np.ndarray]]] = field(default_factory=list)
    begins: dict[int, list[tuple[np.ndarray, np.ndarray]]] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """Control steps of all episodes."""
        return sum(len(ids) for ids, _ in self.events)


class Listening(Engine):
    """An engine that keeps what it gives to its batch."""

    tape: Tape

    def begin(self, ids: np.ndarray, paths: Sequence[Path]) -> np.ndarray:
        """As an engine; the rows are kept."""
        states = super().begin(ids, paths)
        self.tape.slots = self.slots
        self.tape.begins.setdefault(len(self.tape.events), []).append((ids.copy(), self._batch.state[ids].copy()))
        return states

    def step(self, ids: np.ndarray, actions: np.ndarray) -> Step:
        """As an engine; the slots and their inputs are kept."""
        step = super().step(ids, actions)
        ordered = np.sort(ids)
        self.tape.events.append((ordered, [getattr(self, f"_{name}")[ordered].copy() for name in INPUTS]))
        return step


def taped(played: list[policies.Case], source: Prepared) -> Tape:
    """What a rollout of experts gives to its batch."""

    class ThisTape(Listening):
        tape = Tape()

    original, evaluation_rollout.Engine = evaluation_rollout.Engine, ThisTape
    try:
        play(played, source, 0)
    finally:
        evaluation_rollout.Engine = original
    return ThisTape.tape


def play(played: list[policies.Case], source: Prepared, threads: int) -> list[tuple[int, episodes.Episode]]:
    """Experts through the one evaluation loop."""
    return list(rollout(ExpertAgent(), source, played, slots=SLOTS, threads=threads))


def replay(tape: Tape, batch: Batch) -> None:
    """The same physics with nothing around it."""
    inputs = [batch.bind(name) for name in INPUTS]
    for number, (ids, values) in enumerate(tape.events):
        for slots, rows in tape.begins.get(number, ()):
            batch.state[slots] = rows
        for bound, value in zip(inputs, values, strict=True):
            bound[ids] = value
        batch.step(ids, nstep=model.substeps())


@pytest.mark.parametrize("threads", [1, 2])
def test_engine_against_bare_physics(benchmark: BenchmarkFixture, threads: int):
    played = cases(scaled(EPISODES))
    source = Prepared(played)
    tape = taped(played, source)
    batch = Batch(model.load(), tape.slots, threads)
    mine, floor = in_turns(benchmark, lambda: play(played, source, threads), lambda: replay(tape, batch), ROUNDS)
    what = f"Control steps: experts through `rollout`, {threads} thread{'s'[: threads - 1]}"
    rates = tape.steps / mine, tape.steps / floor
    note(benchmark, Row(what, "steps/s", rates[0], "the same inputs to bare `Batch.step`", rates[1], aim=0.95))


def test_the_tape_is_the_rollout():
    """The floor does the same work, to the bit."""
    played = cases(4)
    source = Prepared(played)
    tape = taped(played, source)
    batch = Batch(model.load(), tape.slots, 1)
    replay(tape, batch)
    ends = {index: episode.states[-1] for index, episode in play(played, source, 1)}
    qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
    for index in range(4):  # As many slots as cases: each slot stands where its episode ended.
        np.testing.assert_array_equal(np.concatenate([qpos[index], qvel[index]]), ends[index])


def test_reach_preparation(benchmark: BenchmarkFixture):
    asked = [case.setting for case in cases(scaled(500))]
    source = reaches()
    for setting in asked:
        source.path(setting)  # Splines are kept from the first use on, as in a search.
    seconds = alone(benchmark, lambda: [source.path(setting) for setting in asked], ROUNDS)
    note(benchmark, Row(f"Paths of settings, {source.name} reaches", "paths/s", len(asked) / seconds))
