"""Inputs of benchmarks: recorded reaches if they are available, otherwise minimum-jerk reaches."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from dextron_bench.experts import montecarlo
from dextron_bench.experts.policies import Case, Expert
from dextron_bench.reaches import setting as reaches_setting
from dextron_bench.reaches.reach import Trajectory
from dextron_bench.reaches.recorded.cache import MissingData
from dextron_bench.reaches.setting import Setting, Source
from dextron_bench.reaches.sources import open_source


@cache
def default_source() -> Source:
    """The recorded reaches if they are in the cache or named by DEXTRON_DATA; otherwise minimum-jerk reaches."""
    try:
        return open_source("real")
    except MissingData:
        return open_source("minjerk")


def draw_cases(count: int) -> list[Case]:
    """The same uniformly drawn settings with uniformly drawn experts in each run, as a search draws them."""
    draws = montecarlo.draw(default_source(), montecarlo.Search(default_source().name, experts=1, block=count), 0)
    experts = [Expert(gain, critical) for gain, critical in zip(draws["gain"], draws["critical"], strict=True)]
    settings = reaches_setting.from_frame(draws)
    return [Case(setting, expert, 0.0) for setting, expert in zip(settings, experts, strict=True)]


class PreparedSource:
    """A source that makes all paths before the measurement."""

    def __init__(self, cases: Sequence[Case]) -> None:
        self._source = default_source()
        self._paths = {case.setting: self._source.path(case.setting) for case in cases}
        self.name, self.names = self._source.name, self._source.names

    def path(self, setting: Setting) -> Trajectory:
        """The prepared path of a setting."""
        return self._paths[setting]

    def sample(self, rng: np.random.Generator) -> Setting:
        """A setting that the source draws."""
        return self._source.sample(rng)

    def stratum(self, reach: str) -> reaches_setting.Stratum:
        """Start region of a reach, from the source."""
        return self._source.stratum(reach)

    def duration(self, setting: Setting) -> float:
        """Duration of the reach [s], from the source."""
        return self._source.duration(setting)
