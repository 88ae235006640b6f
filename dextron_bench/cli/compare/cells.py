"""The cells of differences, in the tables of `compare`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

DIFFERENCE = "B - A [95 %]"
HOLM = "p (Holm)"  # The heading of p values that are corrected for their number.


def difference_text(row: Mapping[Any, Any]) -> str:
    """The entries `difference`, `low` and `high` of a row, with two digits."""
    return f"{row['difference']:+.2f} [{row['low']:+.2f}, {row['high']:+.2f}]"
