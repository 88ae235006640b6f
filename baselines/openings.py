"""Openings of the settings of `train`, kept in files by reach: what the labels of STOPPING are made of.

The forks are a privilege of training: they need a simulator that can be copied. An agent sees states alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from dextron_bench import Setting, Track
from dextron_bench.experts.openings import EVERY, NEAR, TOGETHER, Episode, Openings, joined, play
from dextron_bench.storage import atomic, hashing, tensors
from dextron_bench.world import model

FORMAT = 1  # Version of the cached file.


def settings_of(track: Track) -> list[Setting]:
    """The settings of a track's cases, each once, in their order."""
    return list(dict.fromkeys(case.setting for case in track.cases))


def load(track: Track) -> Openings:
    """The openings of a track's settings, played or from its cache; raises DamagedFile.

    The cache has a file for each reach. So a killed call continues, and other choices of reaches share the files.
    """
    settings = settings_of(track)
    by_reach: dict[str, list[Setting]] = {}
    for setting in settings:
        by_reach.setdefault(setting.reach, []).append(setting)
    groups = [(track.cache / f"openings-{_digest(group)[:16]}.safetensors", group) for group in by_reach.values()]
    _play_missing(track, [(file, group) for file, group in groups if not file.exists()])
    episodes = {setting: one for file, group in groups for setting, one in zip(group, _read(file), strict=True)}
    return joined([episodes[setting] for setting in settings])


def _play_missing(track: Track, groups: Sequence[tuple[Path, list[Setting]]]) -> None:
    """Plays groups of settings, at least TOGETHER settings at once, and writes the file of each group."""
    total = sum(len(settings) for _, settings in groups)
    played = 0
    waiting: list[tuple[Path, list[Setting]]] = []
    for number, group in enumerate(groups, 1):
        track.report(played, total, "settings opened, with forks")
        waiting.append(group)
        if sum(len(settings) for _, settings in waiting) < TOGETHER and number < len(groups):
            continue
        episodes = iter(play(track.source, [one for _, settings in waiting for one in settings], track.threads))
        for file, settings in waiting:
            arrays = asdict(joined([next(episodes) for _ in settings]))
            tensors.write(file, arrays, {})
            played += len(settings)
        waiting.clear()


def _read(file: Path) -> list[Episode]:
    """The openings in a file; raises DamagedFile."""
    try:
        stored = Openings(**tensors.read(file))
    except (tensors.BadTensors, TypeError) as error:
        raise atomic.DamagedFile(file, error) from error
    return [(stored.states[rows], stored.outcomes[rows]) for rows in map(stored.rows, range(len(stored)))]


def _digest(settings: Sequence[Setting]) -> str:
    """SHA-256 of everything that the openings depend on."""
    about = f"{FORMAT} {model.mjcf_hash()} {NEAR} {EVERY}"
    return hashing.digest(about.encode(), *(repr(setting).encode() for setting in settings))
