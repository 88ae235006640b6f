"""A bottle: what of it can differ from the model's."""

from __future__ import annotations

from dataclasses import dataclass, fields

import pandas as pd


@dataclass(frozen=True, slots=True)
class Bottle:
    """A cylinder of the model's height: its mass [kg], the sliding friction of all contacts, and its radius [m]."""

    mass: float
    friction: float
    radius: float


COLUMNS = [field.name for field in fields(Bottle)]


def from_frame(rows: pd.DataFrame) -> list[Bottle]:
    """The bottles of a table with the columns `mass`, `friction` and `radius`; empty if it has none of them."""
    if not set(COLUMNS) & set(rows):
        return []
    return [Bottle(*map(float, row)) for row in rows[COLUMNS].itertuples(index=False)]
