"""Expressions that filter tables: values by hand, and nothing that runs code."""

from __future__ import annotations

from contextlib import nullcontext, suppress

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.catalogue.expressions import BadExpression, matches

TABLE = pd.DataFrame(
    {
        "method": ["bc", "bc", "rlil-0.1", "exp"],
        "subject": ["04", "05", "04", "04"],
        "return": [0.0, 20.0, 4.5, 20.0],
        "seed": [0, 1, 0, 2],
        "success": [False, True, False, True],
        "lag": [np.nan, 0.1, -0.2, 0.04],
        "cause": ["too early", "solved", "too late", "solved"],
    }
)


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("", [0, 1, 2, 3]),
        ("cause == 'too late' and subject == '04' and return < 5", [2]),
        ("cause = 'too late' AND NOT return >= 5", [2]),
        ("success", [1, 3]),
        ("not success or seed == 2", [0, 2, 3]),
        ("success == False", [0, 2]),
        ("0 < return < 20", [2]),
        ("seed in (0, 2)", [0, 2, 3]),
        ("method not in ['bc', 'exp']", [2]),
        ("'late' in cause", [2]),
        ("'return' in method", []),
        ("lag > 0", [1, 3]),
        ("lag < 0 or lag == -0.2", [2]),
        ("lag != 0.1", [2, 3]),  # A missing value is not compared.
        ("not lag > 0", [0, 2]),
        ("return > seed", [1, 2, 3]),
        ("1 < 2", [0, 1, 2, 3]),
        ("seed in ()", []),
        ("method < 'c'", [0, 1]),
        ("((success))", [1, 3]),
    ],
)
def test_rows_by_hand(text: str, rows: list[int]) -> None:
    assert np.flatnonzero(matches(TABLE, text)).tolist() == rows


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("__import__('os').system('true')", "is not allowed; allowed are names of columns"),
        ("method.str.len() > 2", "method.str.len() is not allowed"),
        ("(lambda: 1)()", "is not allowed"),
        ("@method == 'bc'", "cannot read"),
        ("return ** 9 > 1", "return ** 9 is not allowed"),
        ("[x for x in (1, 2)]", "is not allowed"),
        ("f'{method}' == 'bc'", "is not allowed"),
        ("(x := 5) > 2", "is not allowed"),
        ("method is 'bc'", "write =="),
        ("caus == 'solved'", "there is no column 'caus'; did you mean cause? columns are method"),
        ("subject == 4", "subject is text, and 4 is a number"),
        ("success > 0", "success is true or false, and 0 is a number"),
        ("-method == 'bc'", "-method is not allowed"),
        ("seed in (0, 'a')", "seed is a number, and 'a' is text"),
        ("seed in 5", "after `in` write a list"),
        ("return", "return is no condition; compare it, as in return == "),
        ("return <", "cannot read 'return <'"),
        ("(return < 5", "cannot read"),
        ("return < 5; success", "cannot read"),
        ("return < 5\nsuccess", "cannot read"),
        ("b'a' == method", "is not allowed"),
        ("return < 1" + "0" * 400, "a number is too large"),
        ("return < 1j", "1j is not allowed"),
        ("(" * 300 + "success" + ")" * 300, "cannot read"),
        ("success or " * 200, "2200 characters; 1000 are allowed"),
        ("\x00", "cannot read"),
    ],
)
def test_what_is_no_filter_is_one_line(text: str, reason: str) -> None:
    with pytest.raises(BadExpression) as caught:
        matches(TABLE, text)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("not " * 40 + "success", [1, 3]),
        ("not " * 241 + "success", [0, 2]),
        ("seed == " + "-" * 40 + "1", [1]),
        ("seed == " + "-" * 900 + "1", [1]),
    ],
)
def test_deep_nesting_is_read_or_refused(text: str, rows: list[int]) -> None:
    """How deep Python itself can read depends on its version."""
    with suppress(BadExpression) if len(text) > 500 else nullcontext():
        assert np.flatnonzero(matches(TABLE, text)).tolist() == rows


@given(st.text(st.sampled_from("return seed'()[],<>=!-.0159 andornot_:@{}\\\"in\n#"), max_size=60))
def test_any_text_selects_rows_or_is_refused(text: str) -> None:
    with suppress(BadExpression):
        assert matches(TABLE, text).shape == (4,)


@given(st.floats(-5.0, 25.0), st.integers(-1, 3))
def test_numbers_compare_as_in_pandas(limit: float, seed: int) -> None:
    expected = (TABLE["return"] < limit) & (TABLE["seed"] >= seed) | ~TABLE["success"]
    np.testing.assert_array_equal(matches(TABLE, f"return < {limit!r} and seed >= {seed} or not success"), expected)
