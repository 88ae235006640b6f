"""Builds the splits of `minjerk`: one reach per row, solved by the one expert of that environment.

The reaches have no offsets, and every number gives another reach. `train` is drawn from the reaches that the source
lists and samples. `val` and `test` are drawn from other reaches, which never occur in training.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dextron_bench.errors import BadInput
from dextron_bench.experts import branching
from dextron_bench.experts.policies import Expert
from dextron_bench.reaches import setting
from dextron_bench.reaches.minjerk import REACHES, MinjerkSource
from dextron_bench.splits import building
from dextron_bench.splits.scanning import Scanner
from dextron_bench.world import task
from dextron_bench.world.engine import Engine

EXPERT = Expert(gain=2.0, critical=0.15)


@dataclass(frozen=True)
class Sizes:
    """Numbers of rows, of points in a scan of d_c, and of reaches that are tried at once."""

    train: int = 600
    val: int = 100
    test: int = 200
    scan: int = 8
    batch: int = 256


def build(folder: Path, engine: Engine, seed: int = 0, sizes: Sizes | None = None) -> dict[str, dict[str, Any]]:
    """Makes, scans and writes the splits of `minjerk` into `folder`; returns their entry in the catalogue.

    Raises BadInput if too few of the first REACHES reaches, or of the next REACHES reaches, are solved.
    """
    sizes = sizes or Sizes()
    source = MinjerkSource()
    parts = draw(source, engine, seed, sizes)
    scanner = Scanner(source, engine)
    tables = [building.scan_split(scanner, name, rows, sizes.scan) for name, rows in parts.items()]
    return building.write(source.name, pd.concat(tables, ignore_index=True), folder)


def draw(source: MinjerkSource, engine: Engine, seed: int, sizes: Sizes) -> dict[str, pd.DataFrame]:
    """The rows of every split, without windows, in an order drawn with the seed."""
    rng = np.random.default_rng([seed, 0, 3])
    listed, unlisted = rng.permutation(REACHES), REACHES + rng.permutation(REACHES)
    train = first_solved(source, listed, sizes.train, engine, sizes.batch)
    held_out = first_solved(source, unlisted, sizes.val + sizes.test, engine, sizes.batch)
    return {"train": train, "val": held_out.iloc[: sizes.val], "test": held_out.iloc[sizes.val :]}


def first_solved(source: MinjerkSource, numbers: np.ndarray, count: int, engine: Engine, batch: int) -> pd.DataFrame:
    """The first `count` rows, in the order of `numbers`, in which EXPERT scores 20; raises BadInput."""
    solved: list[setting.Setting] = []
    for part in np.split(numbers, range(batch, len(numbers), batch)):
        solved += _solved([setting.Setting(f"minjerk-{number:06d}", 0.0, 0.0, 0.0) for number in part], source, engine)
        if len(solved) >= count:
            return setting.to_frame(solved[:count]).assign(gain=EXPERT.gain, critical=EXPERT.critical)
    raise BadInput(f"the splits need {count} solved minjerk reaches and there are {len(solved)}")


def _solved(settings: list[setting.Setting], source: MinjerkSource, engine: Engine) -> Iterator[setting.Setting]:
    """The settings in which EXPERT scores 20, in their order."""
    criticals = np.array([EXPERT.critical])
    batches = (branching.ExpertBatch(source.path(one), EXPERT.gain, criticals) for one in settings)
    returns = {number: outcomes.returns[0] for number, outcomes in branching.play(engine, batches)}
    yield from (one for number, one in enumerate(settings) if returns[number] == task.SUCCESS)
