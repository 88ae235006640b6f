"""How the page describes the origin of a row: measured for runs, declared for submissions."""

from __future__ import annotations

from typing import Any

import pandas as pd

from dextron_bench.leaderboard.page.rows import PageRow, entries
from tests.helpers.results import result

ROW = pd.DataFrame([{"method": "mine", "reaches": "synthetic", "split": "test", "return": 5.0}])


def entry(seconds: float | None = None, **properties: Any) -> PageRow:
    """The entry of a result with these properties, evaluated on a known machine."""
    provenance = {"machine": {"cpu": "the evaluating machine", "cores": 2}, "seconds": seconds}
    (row,) = entries(ROW, [result("mine", 0, "synthetic", provenance=provenance, **properties)])
    return row


def test_a_submission_has_its_declared_properties():
    declared = {"frames": 5000, "demonstrations": 0, "hours": 1.5, "hardware": "a laptop", "privileged": True}
    row = entry(tier="replayed", declared=declared)
    assert (row.frames, row.demonstrations, row.seconds, row.hardware) == (5000, 0, 5400.0, "a laptop")
    assert row.privileged == "more than the state, as declared"
    assert row.tier == "replayed"


def test_a_submission_says_how_many_episodes_equal_their_replay():
    assert entry(tier="replayed", replay={"episodes": 1000, "equal": 998}).equal == "998 of 1,000 equal"
    assert entry().equal is None


def test_a_property_that_is_not_declared_is_unknown():
    row = entry(declared={"frames": None, "demonstrations": None, "hours": None, "hardware": "", "privileged": False})
    assert (row.frames, row.demonstrations, row.seconds, row.hardware) == (None, None, None, None)
    assert row.privileged is None


def test_a_run_has_its_measured_properties():
    row = entry(training={"frames": 7, "demonstrations": 3}, seconds=2.5)
    assert (row.frames, row.demonstrations, row.seconds) == (7, 3, 2.5)
    assert (row.hardware, row.tier) == ("the evaluating machine, 2 cores", "self-reported")
