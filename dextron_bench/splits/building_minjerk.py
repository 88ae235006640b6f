"""How the splits of `minjerk` are made: one reach a row, solved by the one expert of that world.

Its reaches have no offsets, and further ones are to be had by number. So `train` is drawn from the reaches that
the source lists and samples, `val` and `test` from further ones, which nobody meets while training there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.experts import branching
from dextron_bench.experts.policies import Expert
from dextron_bench.reaches import setting
from dextron_bench.reaches.minjerk import REACHES, MinjerkSource
from dextron_bench.splits import building
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

EXPERT = Expert(gain=2.0, critical=0.15)


@dataclass(frozen=True)
class Sizes:
    """Rows of the splits, how finely d_c is scanned, and how many reaches are tried at a time."""

    train: int = 600
    val: int = 100
    test: int = 200
    scan: int = 8
    batch: int = 256


def build(folder: Path, engine: Engine, seed: int = 0, sizes: Sizes | None = None) -> dict[str, dict[str, Any]]:
    """Makes, scans and writes the splits of `minjerk` into `folder`; returns their entry in the catalogue.

    Raises TooFewRows where REACHES listed or as many further reaches are not enough.
    """
    sizes = sizes or Sizes()
    source = MinjerkSource()
    parts = draw(source, engine, seed, sizes)
    tables = [building.scan_split(source, name, rows, engine, sizes.scan) for name, rows in parts.items()]
    return building.write(source.name, pd.concat(tables, ignore_index=True), folder)


def draw(source: MinjerkSource, engine: Engine, seed: int, sizes: Sizes) -> dict[str, pd.DataFrame]:
    """Rows of every split, in an order drawn from the seed, with no windows yet."""
    rng = np.random.default_rng([seed, 0, 3])
    listed, further = rng.permutation(REACHES), REACHES + rng.permutation(REACHES)
    train = first_solved(source, listed, sizes.train, engine, sizes.batch)
    held = first_solved(source, further, sizes.val + sizes.test, engine, sizes.batch)
    return {"train": train, "val": held.iloc[: sizes.val], "test": held.iloc[sizes.val :]}


def first_solved(source: MinjerkSource, numbers: np.ndarray, count: int, engine: Engine, batch: int) -> pd.DataFrame:
    """The first `count` rows, in the order of `numbers`, in which EXPERT scores 20; raises TooFewRows."""
    found: list[setting.Setting] = []
    for tried in np.split(numbers, range(batch, len(numbers), batch)):
        found += _solved([setting.Setting(f"minjerk-{number:06d}", 0.0, 0.0, 0.0) for number in tried], source, engine)
        if len(found) >= count:
            return setting.to_frame(found[:count]).assign(gain=EXPERT.gain, critical=EXPERT.critical)
    raise building.TooFewRows(f"{count} solved minjerk reaches are asked for and there are {len(found)}")


def _solved(tried: list[setting.Setting], source: MinjerkSource, engine: Engine) -> Iterator[setting.Setting]:
    """Those settings in which EXPERT scores 20, in their order."""
    criticals = np.array([EXPERT.critical])
    asked = (branching.ExpertBatch(source.path(each), EXPERT.gain, criticals) for each in tried)
    returns = {number: answer.returns[0] for number, answer in branching.play(engine, asked)}
    yield from (each for number, each in enumerate(tried) if returns[number] == task.SUCCESS)
