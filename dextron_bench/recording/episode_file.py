"""Writes episodes to .rrd files and reads them back, bit for bit.

A property of the file holds a digest of all values, because Rerun itself does not notice a flipped byte.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk

from dextron_bench.errors import BadInput
from dextron_bench.evaluation.episodes import Episode
from dextron_bench.evaluation.phases import phases
from dextron_bench.evaluation.predictions import StepPredictions
from dextron_bench.reaches import reach
from dextron_bench.reaches.setting import Setting
from dextron_bench.recording import blueprint, phase_lane, rrd_file, rrd_format, scene, success_plots
from dextron_bench.recording.digest import digest, lines
from dextron_bench.recording.rrd_file import APPLICATION
from dextron_bench.world import model

ARRAYS = ("states", "actions", "rewards")
ENDS = ("terminated", "truncated", "failure")

Value = str | int | float | bool


@dataclass(frozen=True, slots=True)
class Recording:
    """An episode from a file, and the properties that were given when it was written."""

    episode: Episode
    properties: dict[str, Value]


class BrokenRecording(BadInput):
    """A file is damaged, incomplete, not readable here, or no recording of this project."""

    def __init__(self, file: Path, fault: str) -> None:
        super().__init__(f"{file}: {fault}")


def write(
    file: Path,
    episode: Episode,
    path: reach.Trajectory,
    properties: Mapping[str, Value],
    predictions: StepPredictions | None = None,
) -> str:
    """Writes an episode on the palm's `path` to `file` atomically; returns the SHA-256 of the file.

    With `predictions` the recording also shows what the success model predicts at each step. Raises
    UnwritableRecording, and ValueError if the arrays do not form an episode.
    """
    rr.set_strict_mode(True)
    chunks = [*_chunks(episode, properties), scene.planned_path(path), *scene.chunks(episode.states)]
    if predictions:
        last = len(episode.actions) - 1
        chunks += success_plots.chunks(predictions, episode.actions)
        chunks += success_plots.ridge(predictions, episode.actions[:, 0], last, episode.success)
    static, static_lines = _static_chunks(tuple(predictions.grid.tolist()) if predictions else ())
    identity = digest([*static_lines, *lines(chunks)])
    chunks += [*static, Chunk.from_property("digest", rr.AnyValues(sha256=identity))]
    application = rrd_file.APPLICATION if predictions else rrd_file.PLAIN
    return rrd_file.save(file, chunks, identity, blueprint.blueprint(predictions is not None), application)


def read(file: Path, sha256: str | None = None) -> Recording:
    """The episode in `file`, with arrays bit-equal to the written ones; raises BrokenRecording.

    If the file's SHA-256 is given, it is checked before anything is decoded. For a file that may be damaged and has no
    known SHA-256 use `read_safely`, because Rerun's decoder can abort the process.
    """
    chunks = _load(file, sha256)
    content = [chunk for chunk in chunks if chunk.entity_path != "/__properties/digest"]
    stored_digest = _properties(chunks, "digest").get("sha256")
    if stored_digest is None:
        raise BrokenRecording(file, f"is no recording of {APPLICATION}: it has no digest of its content")
    if stored_digest != digest(lines(content)):
        raise BrokenRecording(file, "its content does not match its digest; it was damaged or changed after writing")
    values: dict[str, Any] = _properties(content, "episode")
    try:
        setting = Setting(*(values[name] for name in Setting.__slots__))
        arrays = {name: _array(content, name) for name in ARRAYS}
        episode = Episode(setting, **arrays, **{name: values[name] for name in ENDS})
    except (ValueError, TypeError) as error:
        raise BrokenRecording(file, f"holds arrays that do not form an episode ({error})") from error
    except (KeyError, StopIteration) as error:
        lacking = f"it lacks {error}" if isinstance(error, KeyError) else "it lacks an array"
        raise BrokenRecording(file, f"is a recording of another version of {APPLICATION}: {lacking}") from error
    return Recording(episode, _properties(content, "run"))


@lru_cache(maxsize=2)
def _static_chunks(grid: tuple[float, ...]) -> tuple[list[Chunk], list[str]]:
    """Chunks that are equal in all recordings with predictions at actions `grid`, or without; lines for the digest."""
    chunks = [*scene.static_chunks(), *blueprint.line_styles(), phase_lane.style()]
    chunks += success_plots.static_chunks(np.array(grid)) if grid else []
    return chunks, list(lines(chunks))


def _chunks(episode: Episode, properties: Mapping[str, Value]) -> Iterable[Chunk]:
    """Arrays and properties of the episode, its text, and the signals that are plotted."""
    steps = len(episode.actions)
    shapes = (steps + 1, model.STATE), (steps, 1), (steps,)
    for name, shape, first in zip(ARRAYS, shapes, (0, 0, 1), strict=True):
        values = getattr(episode, name)
        if not steps or values.shape != shape or values.dtype != np.float64:
            raise ValueError(f"{name} of {steps} steps must be float64 {shape}, not {values.dtype} {values.shape}")
        times = scene.timelines(first, first + len(values) - 1)
        yield Chunk.from_columns(f"/episode/{name}", times, rr.Scalars.columns(scalars=values))
    episode_properties = {**asdict(episode.setting), **{name: getattr(episode, name) for name in ENDS}}
    episode_properties |= {"steps": steps, "episode_return": episode.score, "outcome": blueprint.outcome(episode)}
    yield Chunk.from_property("episode", rr.AnyValues(**_values(episode_properties)))
    if properties:
        yield Chunk.from_property("run", rr.AnyValues(**_values(properties)))
    yield blueprint.text_document(episode, properties)
    yield from blueprint.signals(episode.states)
    yield phase_lane.chunk(phases(episode.states, episode.actions))


def _values(properties: Mapping[str, Value]) -> dict[str, pa.Array]:
    """Properties as Arrow arrays, because Rerun drops empty strings otherwise."""
    return {name: pa.array([value]) for name, value in properties.items()}


def _load(file: Path, sha256: str | None) -> list[Chunk]:
    """All chunks of a whole file; raises BrokenRecording."""
    form = rrd_format.look_at(file)
    if form.fault:
        raise BrokenRecording(file, form.fault)
    if sha256 not in (None, hashlib.sha256(file.read_bytes()).hexdigest()):
        raise BrokenRecording(
            file, "does not have the SHA-256 that was stored for it; it was damaged or changed after writing"
        )
    try:
        return rrd_file.read_chunks(file, form)
    except MemoryError as error:
        raise BrokenRecording(file, "cannot be read (it needs too much memory)") from error
    except Exception as error:  # Rerun's readers raise errors of any type.
        raise BrokenRecording(file, form.undecodable(str(error).partition("\n")[0])) from error


def _properties(chunks: Iterable[Chunk], name: str) -> dict[str, Value]:
    """All properties in the named group."""
    properties: dict[str, Value] = {}
    for chunk in chunks:
        if chunk.entity_path == f"/__properties/{name}":
            columns = chunk.to_record_batch().to_pydict()
            properties |= {key: values[0][0] for key, values in columns.items() if not key.startswith("rerun.")}
    return properties


def _array(chunks: Iterable[Chunk], name: str) -> np.ndarray:
    """An array of the episode, exact and in its original shape."""
    chunk = next(chunk for chunk in chunks if chunk.entity_path == f"/episode/{name}" and not chunk.is_static)
    values = chunk.to_record_batch().column("Scalars:scalars").flatten().to_numpy()
    return values.copy() if name == "rewards" else values.reshape(chunk.num_rows, -1).copy()
