"""Speed of training: stacked updates compared with Stable-Baselines3, whole cycles, and checkpoints."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from pytest_benchmark.fixture import BenchmarkFixture
from safetensors.numpy import save_file

from baselines import rl
from baselines.cycle import FRAMES
from baselines.sac import BATCH, Batch, Sac
from baselines.schedule import Schedule
from dextron_bench.methods.learners import TrainingSetup
from tests.benchmarks.measure import Row, scaled, store_rows, time_in_turns, time_once, time_work
from tests.benchmarks.workload import default_source, draw_cases

ROUNDS = 5
FILLED = 1000  # Transitions in the buffer of Stable-Baselines3.
BUSY = 8  # Other processes that use all of a processor.


class RandomEnv(gymnasium.Env):
    """An environment with the shapes of ours and random states."""

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (48,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """A random state."""
        super().reset(seed=seed)
        return self.np_random.normal(size=48).astype(np.float32), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """A random state and a constant reward."""
        return self.np_random.normal(size=48).astype(np.float32), 0.1, False, False, {}


@cache
def peer_sac():
    """SAC of Stable-Baselines3 with the same layer sizes and a filled buffer."""
    sb3 = pytest.importorskip("stable_baselines3")
    sizes = {"net_arch": [256, 256]}
    sac = sb3.SAC("MlpPolicy", RandomEnv(), batch_size=BATCH, learning_starts=FILLED, policy_kwargs=sizes, device="cpu")
    sac.learn(FILLED)
    return sac


def batches(agents: int, count: int) -> list[tuple[Batch, torch.Tensor]]:
    rng = np.random.default_rng(0)

    def normal(width: int) -> torch.Tensor:
        return torch.tensor(rng.normal(size=(agents, BATCH, width)), dtype=torch.float32)

    alive = torch.ones(agents, BATCH, 1)
    return [(Batch(normal(48), normal(1).tanh(), normal(1), normal(48), alive), normal(1)) for _ in range(count)]


@pytest.mark.parametrize(("agents", "aim"), [(1, None), (3, 4.0), (12, 5.5)])
def test_updates(benchmark: BenchmarkFixture, agents: int, aim: float | None) -> None:
    learner, count = Sac([np.random.default_rng(k) for k in range(agents)]), scaled(200)
    inputs, peer = batches(agents, 8), peer_sac()

    def update() -> None:
        for k in range(count):
            learner.update(*inputs[k % len(inputs)])

    seconds, peer_seconds = time_in_turns(benchmark, update, lambda: peer.train(count, BATCH), ROUNDS)
    what = f"Updates of SAC for each of {agents} stacked agent{'s'[: agents - 1]}"
    against = "an update of Stable-Baselines3's SAC (two critics; the paper has Q and V)"
    store_rows(benchmark, Row(what, "updates/s", count * agents / seconds, against, count / peer_seconds, aim))


@pytest.mark.parametrize("agents", [1, 3, 12])
def test_products(benchmark: BenchmarkFixture, agents: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """How much of an update are matrix products, which no code of ours can make faster on this processor."""
    learner, count = Sac([np.random.default_rng(k) for k in range(agents)]), scaled(200)
    inputs, products = batches(agents, 8), list[Callable[[], torch.Tensor]]()
    with monkeypatch.context() as patch:
        for name in ("bmm", "baddbmm"):
            patch.setattr(torch, name, partial(_call_and_store, getattr(torch, name), products))
        learner.update(*inputs[0])
    flops = sum(_operations(product) for product in products)

    def multiply() -> None:
        for _ in range(count):
            for product in products:
                product()

    def update() -> None:
        for k in range(count):
            learner.update(*inputs[k % len(inputs)])

    seconds, whole_seconds = time_in_turns(benchmark, multiply, update, ROUNDS)
    stacked = f"{agents} stacked agent{'s'[: agents - 1]}"
    rate = f"{count * flops / seconds / 1e9:.0f} GFLOP/s"
    what = f"Matrix products of SAC's updates alone, {stacked} ({1e-6 * flops / agents:.0f} MFLOP each, {rate})"
    store_rows(
        benchmark, Row(what, "updates/s", count * agents / seconds, "whole updates", count * agents / whole_seconds)
    )


def _call_and_store(
    function: Callable[..., torch.Tensor], calls: list[Callable[[], torch.Tensor]], *tensors: torch.Tensor, **named: Any
) -> torch.Tensor:
    """Calls a function, and appends the call to a list."""
    calls.append(partial(function, *tensors, **named))
    return calls[-1]()


def _operations(product: Callable[[], torch.Tensor]) -> int:
    """Floating-point operations of a batched product (n, rows, inner) by (n, inner, columns)."""
    assert isinstance(product, partial)
    left, right = product.args[-2:]
    return 2 * left.numel() * right.shape[-1]


@pytest.mark.parametrize("agents", [1, 3])
def test_cycles(benchmark: BenchmarkFixture, agents: int, tmp_path: Path) -> None:
    setup = TrainingSetup(default_source(), draw_cases(24), tmp_path)
    trainer = rl.trainer(setup, range(agents), Schedule(epochs=100, warm_start=FRAMES, period=1), demonstrated=3)
    trainer.advance()
    trainer.journal()
    rounds = max(1, round(3 * min(1.0, scaled(100) / 100)))
    seconds = time_work(benchmark, trainer.advance, rounds)
    frames = FRAMES / seconds
    hours = 1000 * seconds / 3600
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    journal, state = trainer.journal(), trainer.state()
    size = sum(array.nbytes for array in state.values()) / 1e6
    growth = sum(array.nbytes for array in journal.values()) / 1e6 / rounds
    write_seconds = time_once(lambda: save_file(state, tmp_path / "checkpoint.safetensors"))
    seeds = f"{agents} seed{'s'[: agents - 1]}"
    checkpoint = f"Checkpoint of {seeds}: {size:.0f} MB, and {growth:.2g} MB of experience per epoch"
    store_rows(
        benchmark,
        Row(f"Cycles of RLIL 0.1 with {seeds} (1,000 epochs: {hours:.2g} h)", "frames/s", frames),
        Row(checkpoint, "/s", 1 / write_seconds),
        Row(f"Memory of the whole process after a few epochs of {seeds}", "MB", memory),
    )


def test_threads(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """The default is one thread for the products of torch; the physics has all threads in both."""
    setup = TrainingSetup(default_source(), draw_cases(24), tmp_path)
    trainer = rl.trainer(setup, range(3), Schedule(epochs=100, warm_start=FRAMES, period=1), demonstrated=3)
    trainer.advance()
    cores, before = len(os.sched_getaffinity(0)), torch.get_num_threads()

    def cycles(threads: int) -> None:
        torch.set_num_threads(threads)
        trainer.advance()

    seconds, reference = time_in_turns(benchmark, lambda: cycles(1), lambda: cycles(cores), ROUNDS)
    torch.set_num_threads(before)
    what = "Cycles of RLIL 0.1 with 3 seeds, products of torch on one thread"
    store_rows(benchmark, Row(what, "/s", 1 / seconds, f"on {cores} threads", 1 / reference, 0.9))


def test_busy_machine(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """A training beside other processes gets a share of the processors; more threads would wait for each other."""
    words = ["run", "--method", "rlil", "--preset", "smoke", "--split", "val", "--quiet"]
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}

    def train(name: str) -> None:
        command = [sys.executable, "-m", "dextron_bench", *words, "--runs", str(tmp_path / name)]
        subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)

    quiet = time_once(lambda: train("quiet"))
    with busy_processes():
        seconds = time_work(benchmark, lambda: train("busy"), 1)
    share = min(1.0, len(os.sched_getaffinity(0)) / (BUSY + 1))
    what = f"Trainings of RLIL 0.1 with the preset smoke, beside {BUSY} busy processes"
    against = f"{share:.2f} of the processors of a quiet machine"
    store_rows(benchmark, Row(what, "trainings/h", 3600 / seconds, against, share * 3600 / quiet, 0.5))


@contextmanager
def busy_processes() -> Iterator[None]:
    """Processes that use all of a processor."""
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BUSY)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()
