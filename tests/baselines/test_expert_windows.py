"""Labels of STOPPING without forks, by hand, and a training that uses nothing else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from baselines import expert_windows, openings
from baselines.stopping import BadNumber, Stopping
from dextron_bench.experts.openings import FAILS, NO_DECISION, SUCCEEDS
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.methods.learners import TrainingSetup
from tests.helpers.short_reaches import SETTINGS, SOURCE


def test_closing_works_in_the_window_until_the_hand_goes_away():
    """d_c from 0.15 to 0.35 of 0.4 m is 0.06 to 0.14 m; decisions at 0.15, 0.08 and, on the way back, 0.07 m."""
    distances = np.array([0.4, 0.15, 0.12, 0.08, 0.05, 0.07])
    labels = expert_windows.outcomes(Case(SETTINGS[0], Expert(1.2, 0.25), 0.2), distances)
    assert labels.tolist() == [NO_DECISION, FAILS, NO_DECISION, SUCCEEDS, NO_DECISION, FAILS]
    far = expert_windows.outcomes(Case(SETTINGS[0], Expert(1.2, 0.25), 0.2), np.array([0.4, 0.3, 0.2]))
    assert set(far) == {NO_DECISION}


@pytest.mark.slow
def test_openings_equal_those_with_forks_but_for_their_outcomes():
    cases = [Case(setting, Expert(1.2, 0.3), 2.0) for setting in SETTINGS]
    reported: list[tuple[int, int, str]] = []
    setup = TrainingSetup(SOURCE, cases, Path(), 1, report=lambda *words: reported.append(words))
    played = expert_windows.play(setup, cases)
    forked = openings.play(SOURCE, SETTINGS, threads=1)
    assert reported[-1] == (len(cases), len(cases), "settings opened")
    assert len(played) == len(forked)
    for (states, labels), (expected, outcomes) in zip(played, forked, strict=True):
        np.testing.assert_array_equal(states, expected)
        np.testing.assert_array_equal(labels == NO_DECISION, outcomes == NO_DECISION)
    assert expert_windows.play(setup, [Case(SETTINGS[0], Expert(1.2, 0.3), 0.0)]) == []  # An empty window.


@pytest.mark.slow
def test_a_training_by_windows_plays_no_forks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(openings, "play", None)
    method = Stopping(labels="windows", settings=3)
    assert method.label == "stopping-windows-3"
    trainer = method.trainer(
        TrainingSetup(SOURCE, [Case(one, Expert(1.2, 0.3), 0.4) for one in SETTINGS], tmp_path, 1), [0]
    )
    (metrics,) = trainer.advance()
    assert np.isfinite(metrics["stopping_loss"])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("more", [{"nearby": 0}, {"generated": 10}], ids=str)
def test_other_settings_have_no_windows(more: dict[str, int]):
    with pytest.raises(BadNumber, match="leave out --nearby and --generated"):
        Stopping(labels="windows", **more)
