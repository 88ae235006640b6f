"""Speed of rollouts compared with the bare physics of MuJoCo on the same inputs."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from multiprocessing import get_context

import numpy as np
import pytest
from mujoco.batch import Batch
from pytest_benchmark.fixture import BenchmarkFixture

from dextron_bench.evaluation import episodes
from dextron_bench.evaluation import rollout as evaluation_rollout
from dextron_bench.evaluation.rollout import rollout
from dextron_bench.experts import policies
from dextron_bench.experts.policies import ExpertAgent
from dextron_bench.reaches.reach import Trajectory
from dextron_bench.world import model
from dextron_bench.world.bottle import Bottle
from dextron_bench.world.engine import Engine, Step
from tests.benchmarks.measure import Row, scaled, store_rows, time_in_turns, time_work
from tests.benchmarks.workload import PreparedSource, default_source, draw_cases

EPISODES, SLOTS, ROUNDS = 192, 96, 3
PROCESSES = 2
INPUTS = ("ctrl", "mocap_pos", "mocap_quat")


@dataclass
class Tape:
    """All inputs of a batch: state rows of new episodes by slot, and the slots of each step with their inputs."""

    slots: int = 0
    events: list[tuple[np.ndarray, list[np.ndarray]]] = field(default_factory=list)
    starts: dict[int, list[tuple[np.ndarray, np.ndarray]]] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """Number of control steps of all episodes."""
        return sum(len(ids) for ids, _ in self.events)


class RecordingEngine(Engine):
    """An engine that stores the inputs of its batch on a tape."""

    tape: Tape

    def begin(self, ids: np.ndarray, paths: Sequence[Trajectory], bottles: Sequence[Bottle] = ()) -> np.ndarray:
        """Like the engine's method, and stores the state rows."""
        states = super().begin(ids, paths, bottles)
        self.tape.slots = self.slots
        self.tape.starts.setdefault(len(self.tape.events), []).append((ids.copy(), self._batch.state[ids].copy()))
        return states

    def step(self, ids: np.ndarray, actions: np.ndarray) -> Step:
        """Like the engine's method, and stores the slots and their inputs."""
        step = super().step(ids, actions)
        slots = np.sort(ids)
        self.tape.events.append((slots, [getattr(self, f"_{name}")[slots].copy() for name in INPUTS]))
        return step


def record_tape(cases: list[policies.Case], source: PreparedSource) -> Tape:
    """The tape of a rollout of experts."""

    class ThisEngine(RecordingEngine):
        tape = Tape()

    original, evaluation_rollout.Engine = evaluation_rollout.Engine, ThisEngine
    try:
        play(cases, source, 0)
    finally:
        evaluation_rollout.Engine = original
    return ThisEngine.tape


def play(cases: list[policies.Case], source: PreparedSource, threads: int) -> list[tuple[int, episodes.Episode]]:
    """Plays experts with the function that all evaluations use."""
    return list(rollout(ExpertAgent(), source, cases, slots=SLOTS, threads=threads))


def replay(tape: Tape, batch: Batch) -> None:
    """Steps the same physics without the work around it."""
    inputs = [batch.bind(name) for name in INPUTS]
    for number, (ids, values) in enumerate(tape.events):
        for slots, rows in tape.starts.get(number, ()):
            batch.state[slots] = rows
        for bound, value in zip(inputs, values, strict=True):
            bound[ids] = value
        batch.step(ids, nstep=model.substeps())


@pytest.mark.parametrize("threads", [1, 2])
def test_engine_against_bare_physics(benchmark: BenchmarkFixture, threads: int):
    drawn_cases = draw_cases(scaled(EPISODES))
    source = PreparedSource(drawn_cases)
    tape = record_tape(drawn_cases, source)
    batch = Batch(model.load(), tape.slots, threads)
    seconds, bare_seconds = time_in_turns(
        benchmark, lambda: play(drawn_cases, source, threads), lambda: replay(tape, batch), ROUNDS
    )
    what = f"Control steps: experts through `rollout`, {threads} thread{'s'[: threads - 1]}"
    rates = tape.steps / seconds, tape.steps / bare_seconds
    store_rows(benchmark, Row(what, "steps/s", rates[0], "the same inputs to bare `Batch.step`", rates[1], aim=0.95))


def test_processes_against_bare_physics(benchmark: BenchmarkFixture):
    """Each process plays its half of the episodes on one thread, as the pieces of `--cluster local` do."""
    count = scaled(EPISODES)
    drawn_cases = draw_cases(count)
    tape = record_tape(drawn_cases, PreparedSource(drawn_cases))
    batch = Batch(model.load(), tape.slots, PROCESSES)
    parts = [(count, part) for part in range(PROCESSES)]
    with ProcessPoolExecutor(PROCESSES, get_context("spawn")) as pool:
        steps = sum(pool.map(play_part, *zip(*parts, strict=True)))
        assert steps == tape.steps
        seconds, bare_seconds = time_in_turns(
            benchmark, lambda: list(pool.map(play_part, *zip(*parts, strict=True))), lambda: replay(tape, batch), ROUNDS
        )
    what = f"Control steps: experts through `rollout`, {PROCESSES} processes of 1 thread"
    against = f"the same inputs to bare `Batch.step`, {PROCESSES} threads"
    store_rows(benchmark, Row(what, "steps/s", steps / seconds, against, steps / bare_seconds, aim=0.95))


def play_part(count: int, part: int) -> int:
    """Plays every PROCESSES-th of the drawn cases from number `part` on; returns the number of steps."""
    cases, source = prepared_part(count, part)
    return sum(len(episode.actions) for _, episode in play(cases, source, 1))


@cache
def prepared_part(count: int, part: int) -> tuple[list[policies.Case], PreparedSource]:
    """The cases of a part, with their paths, which are made once in each process."""
    cases = draw_cases(count)[part::PROCESSES]
    return cases, PreparedSource(cases)


def test_the_bare_physics_does_the_work_of_the_rollout():
    """Both end in the same states, bit for bit."""
    four_cases = draw_cases(4)
    source = PreparedSource(four_cases)
    tape = record_tape(four_cases, source)
    batch = Batch(model.load(), tape.slots, 1)
    replay(tape, batch)
    ends = {index: episode.states[-1] for index, episode in play(four_cases, source, 1)}
    qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
    for index in range(4):  # With a slot for each case, each slot holds the end of its episode.
        np.testing.assert_array_equal(np.concatenate([qpos[index], qvel[index]]), ends[index])


def test_reach_preparation(benchmark: BenchmarkFixture):
    settings = [case.setting for case in draw_cases(scaled(500))]
    source = default_source()
    for setting in settings:
        source.path(setting)  # The source keeps splines from their first use on, as in a search.
    seconds = time_work(benchmark, lambda: [source.path(setting) for setting in settings], ROUNDS)
    store_rows(benchmark, Row(f"Paths of settings, {source.name} reaches", "paths/s", len(settings) / seconds))
