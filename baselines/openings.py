"""Openings of the settings of `train` and of settings near them, kept in files by reach: the labels of STOPPING.

The forks are a privilege of training: they need a simulator that can be copied. An agent sees states alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from dextron_bench import Setting, TrainingSetup
from dextron_bench.experts.openings import (
    EVERY,
    NEAR,
    NO_DECISION,
    SUCCEEDS,
    TOGETHER,
    Openings,
    OpeningSteps,
    joined,
    play,
)
from dextron_bench.reaches.setting import OFFSET
from dextron_bench.storage import atomic, hashing, tensors
from dextron_bench.world import model, task

FORMAT = 1  # Version of the cached file.
OFFSET_SHIFT = 0.01  # [m] largest shift of the offset of a nearby setting, in x and in y.
DRAWN_TOGETHER = 5  # Nearby settings in a batch.
NOISE_SHIFT = 0.05, 0.25  # Added to its duration noise. The rows of `hard` keep the noise, so none is near-equal.


def settings_of(setup: TrainingSetup) -> list[Setting]:
    """The settings of a training's cases, each once, in their order."""
    return list(dict.fromkeys(case.setting for case in setup.cases))


def load(setup: TrainingSetup, settings: Sequence[Setting]) -> list[OpeningSteps]:
    """The opening of each setting, played or from its cache; raises DamagedFile.

    The cache has a file for each reach. So a killed call continues, and other choices of reaches share the files.
    """
    by_reach: dict[str, list[Setting]] = {}
    for setting in settings:
        by_reach.setdefault(setting.reach, []).append(setting)
    groups = [(setup.cache / f"openings-{_digest(group)[:16]}.safetensors", group) for group in by_reach.values()]
    _play_missing(setup, [(file, group) for file, group in groups if not file.exists()])
    episodes = {setting: one for file, group in groups for setting, one in zip(group, _read(file), strict=True)}
    return [episodes[setting] for setting in settings]


def rule_succeeds(episode: OpeningSteps, edge: float) -> bool:
    """True if closing succeeds at the first decision of an opening that lies within `edge` [m] of the bottle."""
    states, outcomes = episode
    within = outcomes[(outcomes != NO_DECISION) & (task.distance(states.astype(float)) < edge)]
    return bool(within.size) and within[0] == SUCCEEDS


def load_nearby(setup: TrainingSetup, settings: Sequence[Setting], copies: int) -> list[list[OpeningSteps]]:
    """The openings of `copies` settings near each setting; raises DamagedFile.

    They are drawn and kept in batches, so that trainings with more copies share the files of those with fewer.
    """
    batches = range(-(-copies // DRAWN_TOGETHER))
    played = [load(setup, [near for one in settings for near in nearby(one, batch)]) for batch in batches]
    return [
        [one for batch in played for one in batch[first : first + DRAWN_TOGETHER]][:copies]
        for first in range(0, len(settings) * DRAWN_TOGETHER, DRAWN_TOGETHER)
    ]


def nearby(setting: Setting, batch: int) -> list[Setting]:
    """DRAWN_TOGETHER settings near a setting: with other offsets, and reaches that take a little longer."""
    text = repr(setting) + (f" {batch}" if batch else "")
    rng = np.random.default_rng(int(hashing.digest(text.encode())[:16], 16))
    moves = rng.uniform(-OFFSET_SHIFT, OFFSET_SHIFT, (DRAWN_TOGETHER, 2))
    offsets = np.clip(np.add(moves, [setting.offset_x, setting.offset_y]), -OFFSET, OFFSET)
    noise = setting.duration_noise + rng.uniform(*NOISE_SHIFT, (DRAWN_TOGETHER, 1))
    return [Setting(setting.reach, *values) for values in np.concatenate([offsets, noise], axis=1).tolist()]


def _play_missing(setup: TrainingSetup, groups: Sequence[tuple[Path, list[Setting]]]) -> None:
    """Plays groups of settings, at least TOGETHER settings at once, and writes the file of each group."""
    total = sum(len(settings) for _, settings in groups)
    played = 0
    waiting: list[tuple[Path, list[Setting]]] = []
    for number, group in enumerate(groups, 1):
        setup.report(played, total, "settings opened, with forks")
        waiting.append(group)
        if sum(len(settings) for _, settings in waiting) < TOGETHER and number < len(groups):
            continue
        episodes = iter(play(setup.source, [one for _, settings in waiting for one in settings], setup.threads))
        for file, settings in waiting:
            arrays = asdict(joined([next(episodes) for _ in settings]))
            tensors.write(file, arrays, {})
            played += len(settings)
        waiting.clear()


def _read(file: Path) -> list[OpeningSteps]:
    """The openings in a file; raises DamagedFile."""
    try:
        return Openings(**tensors.read(file)).episodes()
    except (tensors.BadTensors, TypeError) as error:
        raise atomic.DamagedFile(file, error) from error


def _digest(settings: Sequence[Setting]) -> str:
    """SHA-256 of everything that the openings depend on."""
    about = f"{FORMAT} {model.mjcf_hash()} {NEAR} {EVERY}"
    return hashing.digest(about.encode(), *(repr(setting).encode() for setting in settings))
