"""Episodes to .rrd files and back, bit for bit, with a digest that tells damage.

A digest over every value in the file is kept among its properties: Rerun itself does not notice a flipped byte.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.reaches import reach
from dextron_bench.reaches.setting import Setting
from dextron_bench.recording import blueprint, rrd_file, scene, success_plots
from dextron_bench.recording.digest import digest, lines
from dextron_bench.recording.rrd_file import APPLICATION
from dextron_bench.world import model

ARRAYS = ("states", "actions", "rewards")
ENDS = ("terminated", "truncated", "failure")

Value = str | int | float | bool


@dataclass(frozen=True, slots=True)
class Recording:
    """An episode as its file tells it, and the properties that were given with it."""

    episode: Episode
    properties: dict[str, Value]


class BrokenRecording(ValueError):
    """A file that is no whole recording of this project."""

    def __init__(self, file: Path, what: str) -> None:
        super().__init__(f"{file}: {what}")


def write(
    file: Path,
    episode: Episode,
    path: reach.Path,
    properties: Mapping[str, Value],
    insight: StepPredictions | None = None,
) -> str:
    """Writes an episode that followed `path` to `file`, whole or not at all; returns the file's SHA-256.

    With `insight` it also shows what the success model thinks at each step.

    Raises UnwritableRecording, and ValueError where the arrays make no episode.
    """
    rr.set_strict_mode(True)
    chunks = [*_chunks(episode, properties), scene.planned_path(path), *scene.chunks(episode.states)]
    if insight:
        last = len(episode.actions) - 1
        chunks += [*success_plots.static_chunks(insight.grid), *success_plots.chunks(insight, episode.actions)]
        chunks += success_plots.ridge(insight, episode.actions[:, 0], last, episode.success)
    props, told = _props()
    identity = digest([*told, *lines(chunks)])
    chunks += [*props, Chunk.from_property("digest", rr.AnyValues(sha256=identity))]
    application = rrd_file.APPLICATION if insight else rrd_file.PLAIN
    return rrd_file.save(file, chunks, identity, blueprint.blueprint(insight is not None), application)


def read(file: Path, sha256: str | None = None) -> Recording:
    """The episode in `file`, its arrays bit for bit as they were written; raises BrokenRecording.

    The file's SHA-256, if given, is checked before anything is decoded; without it `read_safely` is for files
    that may be damaged, since Rerun's decoder can abort the process.
    """
    chunks = _load(file, sha256)
    kept = [chunk for chunk in chunks if chunk.entity_path != "/__properties/digest"]
    told = _properties(chunks, "digest").get("sha256")
    if told is None:
        raise BrokenRecording(file, f"is no recording of {APPLICATION}: it carries no digest of its content")
    if told != digest(lines(kept)):
        raise BrokenRecording(file, "its content does not match its digest; it was damaged or changed after writing")
    facts: dict[str, Any] = _properties(kept, "episode")
    try:
        setting = Setting(*(facts[name] for name in Setting.__slots__))
        arrays = {name: _array(kept, name) for name in ARRAYS}
        episode = Episode(setting, **arrays, **{name: facts[name] for name in ENDS})
    except (ValueError, TypeError) as error:
        raise BrokenRecording(file, f"holds arrays that make no episode ({error})") from error
    except (KeyError, StopIteration) as error:
        lacking = f"it lacks {error}" if isinstance(error, KeyError) else "it lacks an array"
        raise BrokenRecording(file, f"is a recording of another version of {APPLICATION}: {lacking}") from error
    return Recording(episode, _properties(kept, "run"))


@cache
def _props() -> tuple[list[Chunk], list[str]]:
    """What every recording has, and its lines of the digest."""
    chunks = [*scene.static_chunks(), *blueprint.line_styles()]
    return chunks, list(lines(chunks))


def _chunks(episode: Episode, properties: Mapping[str, Value]) -> Iterable[Chunk]:
    """What is kept of the episode, and what is plotted and told of it."""
    steps = len(episode.actions)
    shapes = (steps + 1, model.STATE), (steps, 1), (steps,)
    for name, shape, first in zip(ARRAYS, shapes, (0, 0, 1), strict=True):
        values = getattr(episode, name)
        if not steps or values.shape != shape or values.dtype != np.float64:
            raise ValueError(f"{name} of {steps} steps must be float64 {shape}, not {values.dtype} {values.shape}")
        when = scene.timelines(first, first + len(values) - 1)
        yield Chunk.from_columns(f"/episode/{name}", when, rr.Scalars.columns(scalars=values))
    facts = {**asdict(episode.setting), **{name: getattr(episode, name) for name in ENDS}}
    facts |= {"steps": steps, "episode_return": episode.score, "outcome": blueprint.outcome(episode)}
    yield Chunk.from_property("episode", rr.AnyValues(**_values(facts)))
    if properties:
        yield Chunk.from_property("run", rr.AnyValues(**_values(properties)))
    yield blueprint.text_card(episode, properties)
    yield from blueprint.signals(episode.states)


def _values(properties: Mapping[str, Value]) -> dict[str, pa.Array]:
    """Arrow values; left to itself, Rerun drops empty strings."""
    return {name: pa.array([value]) for name, value in properties.items()}


def _load(file: Path, sha256: str | None) -> list[Chunk]:
    """All chunks of a whole file; raises BrokenRecording."""
    if not file.is_file():
        raise BrokenRecording(file, "there is no such file")
    if sha256 not in (None, hashlib.sha256(file.read_bytes()).hexdigest()):
        raise BrokenRecording(file, "is not the file whose SHA-256 was kept; it was damaged or changed after writing")
    try:
        return RrdReader(file).store().stream().to_chunks()
    except Exception as error:  # Rerun's readers raise whatever they meet.
        reason = str(error).splitlines()[0]
        raise BrokenRecording(file, f"is cut short, damaged, or no .rrd file ({reason})") from error


def _properties(chunks: Iterable[Chunk], name: str) -> dict[str, Value]:
    """The named group of properties."""
    found: dict[str, Value] = {}
    for chunk in chunks:
        if chunk.entity_path == f"/__properties/{name}":
            columns = chunk.to_record_batch().to_pydict()
            found |= {key: values[0][0] for key, values in columns.items() if not key.startswith("rerun.")}
    return found


def _array(chunks: Iterable[Chunk], name: str) -> np.ndarray:
    """An exact array of the episode, in the shape in which it was given."""
    chunk = next(chunk for chunk in chunks if chunk.entity_path == f"/episode/{name}" and not chunk.is_static)
    values = chunk.to_record_batch().column("Scalars:scalars").flatten().to_numpy()
    return values.copy() if name == "rewards" else values.reshape(chunk.num_rows, -1).copy()
