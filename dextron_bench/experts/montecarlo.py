"""The search for G_s: draws settings and experts at random (paper, II.C); `search_work.py` plays them.

The search runs in blocks of settings. The draws of a block depend only on its number. So a search that was killed can
continue, on any number of threads, and finds the same rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pandas as pd

from dextron_bench.experts import policies
from dextron_bench.reaches import setting

SLOTS = 1024  # Episodes at once, with the slots that are reserved for forks.


class BadSearch(ValueError):
    """Settings of a search that are not possible."""


@dataclass(frozen=True)
class Search:
    """The settings of a search; equal searches find equal rows.

    Each setting is tried with `experts` experts of one gain. The range of d_c is cut into as many equal bands, and each
    expert's d_c is drawn from one band, so that every single draw is uniform as in the paper. `block` settings are
    drawn and stored together.
    """

    reaches: str = "real"
    seed: int = 0
    experts: int = 8
    block: int = 128

    def __post_init__(self) -> None:
        if min(self.experts, self.block) < 1 or self.seed < 0:
            raise BadSearch("a search needs at least one expert and one setting per block, and a seed of 0 or more")


class Sampler(Protocol):
    """What draws settings: a source, or a part of one."""

    def sample(self, rng: np.random.Generator) -> setting.Setting: ...


def draw(source: Sampler, search: Search, block: int) -> pd.DataFrame:
    """The draws of one block, `experts` rows per setting; columns: the fields of `Setting`, `gain`, `critical`."""
    rng = np.random.default_rng([search.seed, block])
    settings = setting.to_frame([source.sample(rng) for _ in range(search.block)])
    low, high = policies.CRITICAL_DISTANCE
    band = np.arange(search.experts) + rng.uniform(size=(search.block, search.experts))
    draws = settings.loc[settings.index.repeat(search.experts)].reset_index(drop=True)
    draws["gain"] = np.repeat(rng.uniform(*policies.GAIN, search.block), search.experts)
    draws["critical"] = (low + (high - low) * band / search.experts).ravel()
    return draws
