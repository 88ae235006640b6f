"""The numbers of the paper's table II that the baselines train with."""

from __future__ import annotations

import numpy as np
import pytest

from baselines import bc, cycle
from baselines.bc import Cloning
from baselines.demonstrations import Demonstrations
from baselines.rlil import Rlil
from baselines.schedule import SCHEDULES

ROWS = np.random.default_rng(0)
# One episode of 20 steps.
DEMONSTRATIONS = Demonstrations(
    ROWS.normal(size=(21, 48)).astype(np.float32), ROWS.uniform(-1.0, 1.0, 21), np.zeros(21), np.array([0, 21])
)


def test_the_paper_trains_for_a_million_frames_after_ten_thousand_random_ones():
    """A million frames are 1,000 epochs; `quick` and `tenth` are the first epochs of the same training."""
    assert cycle.FRAMES * SCHEDULES["paper"].epochs == 1_000_000
    assert [(SCHEDULES[name].epochs, SCHEDULES[name].warm_start) for name in ("paper", "quick", "tenth")] == [
        (1000, 10_000), (200, 10_000), (100, 10_000),
    ]  # fmt: skip
    assert (SCHEDULES["smoke"].epochs, SCHEDULES["smoke"].warm_start) == (2, 1_000)


@pytest.mark.parametrize(("dur", "rows"), [(0.1, 3), (0.3, 9), (0.0, 0), (1.0, 32)])
def test_the_demonstrations_of_a_batch_are_rounded_down(dur: float, rows: int):
    """0.3 of 32 transitions are 9.6; the paper's code takes 9."""
    assert Rlil(dur=dur).demonstrated == rows


def test_the_learning_rate_of_bc_is_halved_every_hundred_epochs(rates: list[float], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(bc, "STEPS", 1)
    cloning = Cloning(DEMONSTRATIONS, [0])
    for epoch in (0, 99, 100, 199, 200):
        cloning.epoch = epoch
        cloning.advance()
    assert rates == [1e-3, 1e-3, 5e-4, 5e-4, 2.5e-4]
