"""Sources of reaches by name."""

from __future__ import annotations

from collections.abc import Callable

from dextron_bench.reaches.setting import ReachSource, Source


class UnknownSource(KeyError):
    """A source of reaches that does not exist."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no source of reaches {name!r}; choose from {', '.join(sorted(SOURCES))}")

    def __str__(self) -> str:
        return str(self.args[0])


def open_source(name: str) -> Source:
    """The source of that name; raises UnknownSource, and MissingData for `real` before its import."""
    try:
        opens = SOURCES[name]
    except KeyError:
        raise UnknownSource(name) from None
    return opens()


def _real() -> Source:
    from dextron_bench.reaches.recorded.cache import load_reaches

    return ReachSource("real", load_reaches())


def _synthetic() -> Source:
    from dextron_bench.reaches.synthetic.generator import open_synthetic

    return open_synthetic()


def _minjerk() -> Source:
    from dextron_bench.reaches.minjerk import MinjerkSource

    return MinjerkSource()


SOURCES: dict[str, Callable[[], Source]] = {"real": _real, "synthetic": _synthetic, "minjerk": _minjerk}
