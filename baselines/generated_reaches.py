"""New reaches from a model of the reaches of `train`, so that STOPPING meets more movements than were recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace

import numpy as np
import threadpoolctl

from dextron_bench import Setting
from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import PALM_AHEAD, Reach
from dextron_bench.reaches.setting import OFFSET, ReachSource, Source
from dextron_bench.reaches.synthetic import fitting, generator
from dextron_bench.reaches.synthetic.parameters import REGIONS, Parameters
from dextron_bench.storage import hashing


class NoModel(ValueError):
    """Reaches to which no model can be fitted."""


def generate(source: Source, known: Sequence[Setting], count: int) -> tuple[ReachSource, list[Setting]]:
    """A source with `count` new reaches, and a setting on each of them.

    The model is fitted to the reaches of the `known` settings alone, which an expert solves. A new setting has the
    offset of a random known one, as the arriving palm sees it, because few random offsets can be solved. Equal settings
    give equal results. The names of the new reaches contain the model's hash. Raises NoModel.
    """
    names = sorted({setting.reach for setting in known})
    reaches = {name: source.reach(name) for name in names} if isinstance(source, ReachSource) else {}
    if (regions := len({(reach.ring, reach.angle) for reach in reaches.values()})) < REGIONS:
        raise NoModel(f"the reaches start in {regions} of {REGIONS} regions, too few for a model; use --generated 0")
    with threadpoolctl.threadpool_limits(1, user_api="blas"):  # The last bits of a fit depend on the threads.
        parameters = fitting.fit(list(reaches.values()), seed=0)
    model, rng = _digest(parameters)[:16], np.random.default_rng(0)
    new = [replace(generator.generate(k, parameters), name=f"{model}-{k:04d}") for k in range(count)]
    return ReachSource("generated", new), [_draw(reach, known, reaches, rng) for reach in new]


def _draw(reach: Reach, known: Sequence[Setting], reaches: Mapping[str, Reach], rng: np.random.Generator) -> Setting:
    """A random setting on a reach, with the offset of a known one on another reach, turned with the palm."""
    like = known[int(rng.integers(len(known)))]
    turn = _heading(reach) - _heading(reaches[like.reach])
    offset = np.exp(1j * turn) * complex(like.offset_x, like.offset_y)
    x, y = np.clip([offset.real, offset.imag], -OFFSET, OFFSET).tolist()
    return replace(ReachSource(reach.name, [reach]).sample(rng), offset_x=x, offset_y=y)


def _heading(reach: Reach) -> float:
    """Angle [rad] about the vertical at which the palm points when the hand arrives."""
    _, quaternions = reach.curve(np.array([reach.reached]))
    ahead = rotation.rotate(quaternions, PALM_AHEAD)[0]
    return float(np.arctan2(ahead[1], ahead[0]))


def _digest(parameters: Parameters) -> str:
    """SHA-256 of all parameters."""
    return hashing.digest(
        *(np.ascontiguousarray(getattr(parameters, one.name)).tobytes() for one in fields(Parameters))
    )
