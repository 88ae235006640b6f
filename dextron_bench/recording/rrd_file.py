"""Writes Rerun's .rrd files atomically, and reads them."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.api import create_in_memory_blueprint
from rerun.chunk import Chunk, RrdReader
from rerun_bindings import (
    PyMemorySinkStorage,
    flush_and_cleanup_orphaned_recordings,
    new_blueprint,
    send_blueprint,
)

from dextron_bench.recording.rrd_format import RrdFormat
from dextron_bench.storage import atomic

APPLICATION = "dextron-bench"  # Rerun's application id of recordings with predictions.
PLAIN, PAIRS = f"{APPLICATION}-plain", f"{APPLICATION}-pairs"  # The viewer has one layout for each application id.
APPLICATIONS = APPLICATION, PLAIN, PAIRS


class UnwritableRecording(OSError):
    """A recording cannot be written; the file is unchanged."""

    def __init__(self, file: Path, reason: object) -> None:
        super().__init__(f"cannot write recording {file}: {reason}")
        self.file, self.reason = file, str(reason)

    def __reduce__(self) -> tuple[type[UnwritableRecording], tuple[Path, str]]:
        return UnwritableRecording, (self.file, self.reason)  # It comes from processes that write recordings.


def save(
    file: Path, chunks: Iterable[Chunk], identity: str, blueprint: rrb.Blueprint, application: str = APPLICATION
) -> str:
    """Writes chunks to `file` atomically; returns the file's SHA-256. Raises UnwritableRecording."""
    try:
        content = _encoded(chunks, identity, blueprint, application)
        atomic.write_atomically(file, lambda part: part.write_bytes(content))
    except (OSError, RuntimeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise UnwritableRecording(file, reason) from error
    return hashlib.sha256(content).hexdigest()


def read_chunks(file: Path, form: RrdFormat) -> list[Chunk]:
    """All chunks of a whole file of a format; raises errors of any type, as Rerun's readers do."""
    with warnings.catch_warnings(action="ignore"):  # Rerun warns of each file without a footer.
        reader = RrdReader(file)
        return (reader.store() if form.has_footer else reader).stream().to_chunks()


def _encoded(chunks: Iterable[Chunk], identity: str, blueprint: rrb.Blueprint, application: str) -> bytes:
    """The bytes of an .rrd file; raises RuntimeError if the environment variable RERUN switches Rerun off.

    Rerun's own function for this encodes the blueprint again for each file, and leaves two threads running.
    """
    recording = rr.RecordingStream(application, recording_id=identity, send_properties=False)
    try:
        if not rr.is_enabled(recording):
            raise RuntimeError("Rerun is switched off by RERUN in the environment; unset it")
        memory = recording.memory_recording()
        recording.send_chunks(chunks)
        # The layout comes first: the web viewer lays out what it has, and would not change it for a later one.
        content: bytes = _encoded_blueprint(blueprint, application).concat_as_bytes(memory.storage)
        memory.drain_as_bytes()  # Rerun warns about chunks that stay in memory.
        recording.disconnect()
    finally:
        del recording
        flush_and_cleanup_orphaned_recordings()
    return content


@lru_cache(maxsize=2)
def _encoded_blueprint(blueprint: rrb.Blueprint, application: str) -> PyMemorySinkStorage:
    """A blueprint and the command that activates it, encoded as in a file. Each one keeps four threads running.

    Rerun (0.41) has no public function that encodes a blueprint once for many files.
    """
    stream = create_in_memory_blueprint(application_id=application, blueprint=blueprint)
    carrier = rr.RecordingStream._from_native(
        new_blueprint(application_id=application, make_default=False, make_thread_default=False, default_enabled=True)
    )
    memory = carrier.memory_recording()
    send_blueprint(stream.storage, make_active=False, make_default=True, recording=carrier.to_native())
    return memory.storage
