"""The flags that select episodes, in the same words for every command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dextron_bench.reaches.sources import SourceName

if TYPE_CHECKING:
    from dextron_bench.catalogue.selection import EpisodeFilter


@dataclass(frozen=True)
class EpisodeFlags:
    """Flags that select episodes by run, split and outcome; by default all pass."""

    worst: int | None = None
    """Select this many episodes with the lowest return."""
    best: int | None = None
    """Select this many episodes with the highest return."""
    method: tuple[str, ...] = ()
    """Select only episodes of these methods, by their names on the leaderboard."""
    reaches: tuple[SourceName, ...] = ()
    """Select only episodes on these sources of reaches."""
    split: tuple[str, ...] = ()
    """Select only episodes of these splits."""
    seed: tuple[int, ...] = ()
    """Select only episodes of agents with these seeds."""
    failed: bool = False
    """Select only episodes without success."""
    cause: tuple[str, ...] = ()
    """Select only episodes with this cause, such as "too late"; docs/diagnosis.md lists all causes."""
    row: tuple[int, ...] = ()
    """Select only these rows of the splits."""
    where: str = ""
    """Select only episodes that match an expression, as in `browse`: "cause == 'too late' and return < 5"."""

    def episode_filter(self) -> EpisodeFilter:
        """The filter of these flags; raises BadFilter."""
        from dextron_bench.catalogue.selection import EpisodeFilter

        return EpisodeFilter(**{name: getattr(self, name) for name in EpisodeFilter.__slots__})
