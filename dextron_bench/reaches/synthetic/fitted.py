"""New reaches from a model that is fitted to given reaches, and to nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import threadpoolctl

from dextron_bench.errors import BadInput
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.setting import ReachSource
from dextron_bench.reaches.synthetic import fitting, generator
from dextron_bench.reaches.synthetic.parameters import REGIONS, Parameters
from dextron_bench.storage import hashing


class TooFewRegions(BadInput):
    """Reaches that leave out a start region, so that no model can be fitted to them."""

    def __init__(self, regions: int) -> None:
        super().__init__(f"the reaches start in {regions} of {REGIONS} regions, too few for a model of reaches")


def generate(reaches: Sequence[Reach], count: int) -> ReachSource:
    """A source with `count` new reaches, from a model of the given ones.

    Equal reaches give equal sources. The names of the new reaches contain the model's hash. Raises TooFewRegions.
    """
    if (regions := len({(reach.ring, reach.angle) for reach in reaches})) < REGIONS:
        raise TooFewRegions(regions)
    with threadpoolctl.threadpool_limits(1, user_api="blas"):  # The last bits of a fit depend on the threads.
        parameters = fitting.fit(reaches, seed=0)
    model = _digest(parameters)[:16]
    new = [replace(generator.generate(k, parameters), name=f"{model}-{k:04d}") for k in range(count)]
    return ReachSource("generated", new)


def _digest(parameters: Parameters) -> str:
    """SHA-256 of all parameters."""
    return hashing.digest(
        *(np.ascontiguousarray(getattr(parameters, one.name)).tobytes() for one in fields(Parameters))
    )
