"""The row of an episode in the table of episodes."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from dextron_bench.evaluation import diagnosis
from dextron_bench.evaluation.episodes import Episode, fingerprint
from dextron_bench.splits.loading import Split


def row(split: Split, index: int, episode: Episode) -> dict[str, Any]:
    """An episode's row in the table of episodes; setting and actions are enough to replay it bit for bit."""
    diagnosed = diagnosis.diagnose(episode, split.case(index))
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
        "cause": diagnosed.cause,
        "closing_lag": diagnosed.closing_lag,
        "actions": episode.actions[:, 0],
        "trace": fingerprint(episode),
        "final": episode.states[-1],
    }
