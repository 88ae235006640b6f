"""Files of Rerun written whole or not at all."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.api import create_in_memory_blueprint
from rerun.chunk import Chunk
from rerun_bindings import (
    PyMemorySinkStorage,
    flush_and_cleanup_orphaned_recordings,
    new_blueprint,
    send_blueprint,
)

from dextron_bench.storage import atomic

APPLICATION = "dextron-bench"  # To the viewer, recordings in which success is foretold.
PLAIN, PAIRS = f"{APPLICATION}-plain", f"{APPLICATION}-pairs"  # Others, since it has one layout an application.
APPLICATIONS = APPLICATION, PLAIN, PAIRS


class UnwritableRecording(OSError):
    """A recording that could not be written; nothing was."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"cannot write recording {file}: {why}")


def save(
    file: Path, chunks: Iterable[Chunk], identity: str, blueprint: rrb.Blueprint, application: str = APPLICATION
) -> str:
    """Writes chunks to `file`, whole or not at all; returns the file's SHA-256. Raises UnwritableRecording."""
    try:
        content = _encoded(chunks, identity, blueprint, application)
        atomic.write_atomically(file, lambda part: part.write_bytes(content))
    except (OSError, RuntimeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise UnwritableRecording(file, why) from error
    return hashlib.sha256(content).hexdigest()


def _encoded(chunks: Iterable[Chunk], identity: str, blueprint: rrb.Blueprint, application: str) -> bytes:
    """The bytes of an .rrd file; raises RuntimeError where Rerun, switched off, would make none.

    Rerun's own way to a file makes the blueprint anew each time, and leaves two threads behind.
    """
    recording = rr.RecordingStream(application, recording_id=identity, send_properties=False)
    try:
        if not rr.is_enabled(recording):
            raise RuntimeError("Rerun is switched off by RERUN in the environment; unset it")
        memory = recording.memory_recording()
        recording.send_chunks(chunks)
        content: bytes = memory.storage.concat_as_bytes(_prepared(blueprint, application))
        memory.drain_as_bytes()  # Rerun warns of what is left in memory.
        recording.disconnect()
    finally:
        del recording
        flush_and_cleanup_orphaned_recordings()
    return content


@lru_cache(maxsize=2)
def _prepared(blueprint: rrb.Blueprint, application: str) -> PyMemorySinkStorage:
    """A blueprint, and that it is the one to open with, as Rerun adds them to files; it holds four threads.

    Rerun (0.41) has no public way to make it once for many files.
    """
    made = create_in_memory_blueprint(application_id=application, blueprint=blueprint)
    carrier = rr.RecordingStream._from_native(
        new_blueprint(application_id=application, make_default=False, make_thread_default=False, default_enabled=True)
    )
    kept = carrier.memory_recording()
    send_blueprint(made.storage, make_active=False, make_default=True, recording=carrier.to_native())
    return kept.storage
