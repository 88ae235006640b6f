"""What the page says of how a row was made: of our runs what was measured, of submissions what was declared."""

from __future__ import annotations

from typing import Any

import pandas as pd

from dextron_bench.leaderboard.page.rows import Entry, entries

ROW = pd.DataFrame([{"method": "mine", "reaches": "synthetic", "split": "test", "return": 5.0}])


def entry(seconds: float | None = None, **told: Any) -> Entry:
    made = {"machine": {"cpu": "that of the evaluation", "cores": 2}, "seconds": seconds}
    (found,) = entries(ROW, [{"method": "mine", "reaches": "synthetic", "seed": 0, "provenance": made, **told}])
    return found


def test_a_submission_has_what_was_declared():
    declared = {"frames": 5000, "demonstrations": 0, "hours": 1.5, "hardware": "a laptop", "privileged": True}
    found = entry(tier="replayed", declared=declared)
    assert (found.frames, found.demonstrations, found.seconds, found.hardware) == (5000, 0, 5400.0, "a laptop")
    assert found.privileged == "more than the state, as declared"
    assert found.tier == "replayed"


def test_what_was_not_declared_is_not_known():
    found = entry(declared={"frames": None, "demonstrations": None, "hours": None, "hardware": "", "privileged": False})
    assert (found.frames, found.demonstrations, found.seconds, found.hardware) == (None, None, None, None)
    assert found.privileged is None


def test_a_run_has_what_was_measured():
    found = entry(training={"frames": 7, "demonstrations": 3}, seconds=2.5)
    assert (found.frames, found.demonstrations, found.seconds) == (7, 3, 2.5)
    assert (found.hardware, found.tier) == ("that of the evaluation, 2 cores", "self-reported")
