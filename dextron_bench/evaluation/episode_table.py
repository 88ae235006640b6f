"""The row of an episode in the table of episodes."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from dextron_bench.evaluation import diagnosis
from dextron_bench.evaluation.episodes import Episode, fingerprint
from dextron_bench.splits.loading import Split


class Row(TypedDict):
    """A row of the table of episodes."""

    split: str
    digest: str
    row: int
    reach: str
    offset_x: float
    offset_y: float
    duration_noise: float
    score: float
    success: bool
    length: int
    terminated: bool
    truncated: bool
    failure: str
    cause: str
    closing_lag: float
    actions: np.ndarray
    trace: str
    final: np.ndarray


def row(split: Split, index: int, episode: Episode) -> Row:
    """An episode's row in the table of episodes; setting and actions are enough to replay it bit for bit."""
    diagnosed = diagnosis.diagnose(episode, split.case(index))
    setting = episode.setting
    return {
        "split": split.name,
        "digest": split.digest,
        "row": index,
        "reach": setting.reach,
        "offset_x": setting.offset_x,
        "offset_y": setting.offset_y,
        "duration_noise": setting.duration_noise,
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
