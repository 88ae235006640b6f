"""Settings on new reaches from a model of the reaches of `train`, so that STOPPING meets more movements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dextron_bench import Setting
from dextron_bench.reaches import rotation
from dextron_bench.reaches.reach import PALM_AHEAD, Reach
from dextron_bench.reaches.setting import OFFSET, ReachSource, Source
from dextron_bench.reaches.synthetic import fitted


def generate(source: Source, known: Sequence[Setting], count: int) -> tuple[ReachSource, list[Setting]]:
    """A source with `count` new reaches, and a setting on each of them.

    The model is fitted to the reaches of the `known` settings alone, which an expert solves. A new setting has the
    offset of a random known one, as the arriving palm sees it, because few random offsets can be solved. Equal settings
    give equal results. Raises TooFewRegions, also for a source without reaches.
    """
    names = sorted({setting.reach for setting in known})
    reaches = {name: source.reach(name) for name in names} if isinstance(source, ReachSource) else {}
    new, rng = fitted.generate(list(reaches.values()), count), np.random.default_rng(0)
    return new, [_draw(new.reach(name), known, reaches, rng) for name in new.names]


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
