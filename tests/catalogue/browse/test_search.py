"""Searches: what a query asks, and addresses that ask the same again."""

from __future__ import annotations

from urllib.parse import parse_qsl

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dextron_bench.catalogue.browse.search import ORDERS, SHOWN, Search
from dextron_bench.catalogue.episodes import COLUMNS, STATE

EPISODES = pd.DataFrame(
    dict.fromkeys((*COLUMNS, STATE), "")
    | {"return": [3.0, 20.0, 0.0], "closing_lag": [0.2, np.nan, -0.1], "steps": [5, 9, 7], "cause": ["a'b", "c", "c"]}
)


@pytest.mark.parametrize(
    ("query", "rows"),
    [
        ({}, [0, 1, 2]),
        ({"order": "worst first"}, [2, 0, 1]),
        ({"order": "best first", "where": "return < 20"}, [0, 2]),
        ({"order": "latest closing first"}, [0, 2, 1]),  # Without a closing comes last.
        ({"order": "nonsense", "page": "x"}, [0, 1, 2]),
    ],
)
def test_episodes_in_order(query: dict[str, str], rows: list[int]):
    assert Search.of(query).matching(EPISODES).index.tolist() == rows


def test_a_search_is_narrowed_to_a_cause_with_a_quote():
    """`or` in the first condition must not take the second one away."""
    narrowed = Search("return < 1 or return > 2", page=3).narrowed('cause == "a\'b"')
    assert narrowed.matching(EPISODES).index.tolist() == [0]
    assert narrowed.page == 1
    assert Search().narrowed("cause == 'c'").where == "cause == 'c'"


def test_pages_by_hand():
    many = pd.concat([EPISODES] * 17, ignore_index=True)  # 51 episodes on pages of 24.
    assert [Search(page=page).part(many).index.tolist() for page in (3, 4)] == [[48, 49, 50], []]
    assert (Search().pages(many), Search().pages(many[: 2 * SHOWN]), Search().pages(many[:0])) == (3, 2, 1)


@given(st.text(max_size=20), st.sampled_from(list(ORDERS)), st.integers(1, 10**6))
def test_an_address_asks_the_same_again(where: str, order: str, page: int):
    where = where.encode(errors="replace").decode()
    address = Search(where, order, page).address
    assert address.isascii()
    assert Search.of(dict(parse_qsl(address.partition("?")[2]))) == Search(where, order, page)
