"""What a request for the page asks: an expression, an order and a part of the episodes that match."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self
from urllib.parse import urlencode

import pandas as pd

from dextron_bench.catalogue import expressions
from dextron_bench.catalogue.episodes import COLUMNS

SHOWN = 24  # Cards on a page.
ORDERS = {  # Name of each order, with its column and whether the lowest values come first.
    "as played": ("", True),
    "worst first": ("return", True),
    "best first": ("return", False),
    "earliest closing first": ("closing_lag", True),
    "latest closing first": ("closing_lag", False),
    "shortest first": ("steps", True),
}
DEFAULT = next(iter(ORDERS))


class UnknownOrder(ValueError):
    """No order of episodes has this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no order {name!r}; choose from {', '.join(map(repr, ORDERS))}")


@dataclass(frozen=True, slots=True)
class Search:
    """An expression that episodes match (all if it is empty), their order, and the number of the page from 1 on.

    Raises UnknownOrder.
    """

    where: str = ""
    order: str = DEFAULT
    page: int = 1

    def __post_init__(self) -> None:
        if self.order not in ORDERS:
            raise UnknownOrder(self.order)

    @classmethod
    def of(cls, query: Mapping[str, str]) -> Self:
        """The search of a query; what is wrong or missing has its default."""
        order, page = query.get("order", DEFAULT), query.get("page", "1")
        is_number = page.isascii() and page.isdigit() and len(page) < 8
        return cls(query.get("where", ""), order if order in ORDERS else DEFAULT, max(int(page), 1) if is_number else 1)

    @property
    def address(self) -> str:
        """The address of the page with this search."""
        values = {"where": self.where, "order": self.order, "page": self.page}
        query = urlencode({name: value for name, value in values.items() if value not in ("", DEFAULT, 1)})
        return f"/?{query}" if query else "/"

    def matching(self, episodes: pd.DataFrame) -> pd.DataFrame:
        """The episodes that match, in order; raises BadExpression."""
        table = expressions.filtered(episodes, self.where, COLUMNS)
        column, ascending = ORDERS[self.order]
        return table.sort_values(column, ascending=ascending, kind="stable") if column else table

    def part(self, matching: pd.DataFrame) -> pd.DataFrame:
        """The episodes on this page, of those that match."""
        return matching.iloc[(self.page - 1) * SHOWN : self.page * SHOWN]

    def pages(self, matching: pd.DataFrame) -> int:
        """How many pages the matching episodes fill, 1 or more."""
        return max(-(-len(matching) // SHOWN), 1)

    def narrowed(self, condition: str) -> Self:
        """The first page of the same search with one more condition."""
        return replace(self, where=f"({self.where}) and {condition}" if self.where.strip() else condition, page=1)

    def at(self, page: int) -> Self:
        """Another page of the same search."""
        return replace(self, page=page)
