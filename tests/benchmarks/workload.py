"""What benchmarks work on: recorded reaches where they are at hand, made ones else."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from dextron_bench.experts import montecarlo
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches import setting as reaches_setting
from dextron_bench.reaches.reach import Path
from dextron_bench.reaches.recorded.cache import MissingData
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.reaches.sources import open_source


@cache
def reaches() -> Source:
    """The recorded reaches, from the cache or as DEXTRON_DATA names them, or else the simulated trajectories."""
    try:
        return open_source("real")
    except MissingData:
        return open_source("minjerk")


def cases(count: int) -> list[Case]:
    """Uniform settings with uniform experts, as a search draws them; always the same."""
    draws = montecarlo.draw(reaches(), montecarlo.Search(reaches().name, experts=1, block=count), 0)
    experts = [Expert(gain, critical) for gain, critical in zip(draws["gain"], draws["critical"], strict=True)]
    return [Case(s, e, 0.0) for s, e in zip(reaches_setting.from_frame(draws), experts, strict=True)]


class Prepared:
    """A source whose paths are made before anything is measured."""

    def __init__(self, cases: Sequence[Case]) -> None:
        self._source = reaches()
        self._paths = {case.setting: self._source.path(case.setting) for case in cases}
        self.name, self.names = self._source.name, self._source.names

    def path(self, setting: Setting) -> Path:
        """The path made before."""
        return self._paths[setting]

    def sample(self, rng: np.random.Generator) -> Setting:
        """As the source itself."""
        return self._source.sample(rng)

    def stratum(self, reach: str) -> reaches_setting.Stratum:
        """As the source itself."""
        return self._source.stratum(reach)

    def duration(self, setting: Setting) -> float:
        """As the source itself."""
        return self._source.duration(setting)
