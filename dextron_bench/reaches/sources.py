"""Sources of reaches by name.

The command line takes its types from this module, so the module imports nothing heavy: each source is imported when it
is opened.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

from dextron_bench.errors import NotFound

if TYPE_CHECKING:
    from dextron_bench.reaches.setting import Source

SourceName = Literal["real", "synthetic", "minjerk"]
RankedSource = Literal["real", "synthetic"]  # The sources that take submissions; `minjerk` has one expert only.


class UnknownSource(NotFound):
    """A source of reaches that does not exist."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no source of reaches {name!r}; choose from {', '.join(sorted(SOURCES))}")

    def __str__(self) -> str:
        return str(self.args[0])


def open_source(name: str) -> Source:
    """Returns the source of that name. Raises UnknownSource, and MissingData for `real` before its import."""
    try:
        opener = SOURCES[name]
    except (KeyError, TypeError):  # A list, for example, is no key.
        raise UnknownSource(name) from None
    return opener()


def _open_real() -> Source:
    from dextron_bench.reaches.recorded.cache import load_reaches
    from dextron_bench.reaches.setting import ReachSource

    return ReachSource("real", load_reaches())


def _open_synthetic() -> Source:
    from dextron_bench.reaches.synthetic.generator import open_synthetic

    return open_synthetic()


def _open_minjerk() -> Source:
    from dextron_bench.reaches.minjerk import MinjerkSource

    return MinjerkSource()


SOURCES: dict[str, Callable[[], Source]] = {
    "real": _open_real,
    "synthetic": _open_synthetic,
    "minjerk": _open_minjerk,
}
