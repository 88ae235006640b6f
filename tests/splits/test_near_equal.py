"""Near-equal settings lie on one reach and differ by less than three limits."""

import pandas as pd

from dextron_bench.splits.near_equal import SETTING, without_near_equal


def test_near_equal_settings_are_dropped():
    held_out = pd.DataFrame([["a", 0.01, 0.02, 0.5]], columns=SETTING)
    rows = pd.DataFrame(
        [
            ["a", 0.0105, 0.0205, 0.51],  # Near-equal in all three numbers.
            ["a", 0.0115, 0.02, 0.5],  # 1.5 mm apart.
            ["a", 0.01, 0.02, 0.53],  # Another duration.
            ["b", 0.01, 0.02, 0.5],  # Another reach.
        ],
        columns=SETTING,
    )
    assert without_near_equal(rows, held_out).index.tolist() == [1, 2, 3]
