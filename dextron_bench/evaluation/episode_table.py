"""An episode as a row of the table of episodes."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from dextron_bench.evaluation import diagnosis
from dextron_bench.evaluation.episodes import Episode, fingerprint
from dextron_bench.splits.loading import Split


def row(split: Split, index: int, episode: Episode) -> dict[str, Any]:
    """An episode's row of the table of episodes; with its actions it can be played again, bit for bit."""
    found = diagnosis.diagnose(episode, split.cases[index])
    return {
        "split": split.name,
        "digest": split.digest,
        "row": index,
        **asdict(episode.setting),
        "score": episode.score,
        "success": episode.success,
        "length": len(episode.actions),
        "terminated": episode.terminated,
        "truncated": episode.truncated,
        "failure": episode.failure,
        "cause": found.cause,
        "closing_lag": found.closing_lag,
        "actions": episode.actions[:, 0],
        "trace": fingerprint(episode),
        "final": episode.states[-1],
    }
