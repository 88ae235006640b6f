"""Short proofs of what happened in an episode: since equal settings and actions give equal bits, one hash tells all."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dextron_bench import provenance
from dextron_bench.rollout import Episode

SHORT = 12  # Hexadecimal digits of a hash of actions in a result.


def trace(episode: Episode) -> str:
    """SHA-256 over all states, actions and rewards, hexadecimal."""
    arrays = (episode.states, episode.actions, episode.rewards)
    return provenance.digest(*(np.ascontiguousarray(each, "<f8").tobytes() for each in arrays))


def of_actions(actions: Iterable[np.ndarray]) -> list[str]:
    """The first digits of each episode's hash of its actions (T,), by which a copied episode is known."""
    return [provenance.digest(np.ascontiguousarray(each, "<f8").tobytes())[:SHORT] for each in actions]
