"""Files of Rerun written whole or not at all."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk
from rerun_bindings import flush_and_cleanup_orphaned_recordings

APPLICATION = "dextron-bench"


class UnwritableRecording(OSError):
    """A recording that could not be written; nothing was."""

    def __init__(self, file: Path, why: object) -> None:
        super().__init__(f"cannot write recording {file}: {why}")


def save(file: Path, chunks: Iterable[Chunk], identity: str, blueprint: rrb.Blueprint) -> str:
    """Writes chunks to `file`, whole or not at all; returns the file's SHA-256. Raises UnwritableRecording."""
    temporary = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch()
        _save(temporary, chunks, identity, blueprint)
        sha256 = _seal(temporary)
        os.replace(temporary, file)
    except (OSError, RuntimeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise UnwritableRecording(file, why) from error
    finally:
        with suppress(OSError):
            temporary.unlink()
    return sha256


def _save(file: Path, chunks: Iterable[Chunk], identity: str, blueprint: rrb.Blueprint) -> None:
    """Writes chunks and blueprint; raises RuntimeError where Rerun cannot or, switched off, would not."""
    recording = rr.RecordingStream(APPLICATION, recording_id=identity, send_properties=False)
    try:
        if not rr.is_enabled(recording):
            raise RuntimeError("Rerun is switched off by RERUN in the environment; unset it")
        recording.save(file, default_blueprint=blueprint)
        recording.send_chunks(chunks)
        recording.disconnect()
    finally:
        del recording
        flush_and_cleanup_orphaned_recordings()


def _seal(file: Path) -> str:
    """Makes the file's bytes last; returns their SHA-256."""
    with file.open("rb") as opened:
        os.fsync(opened.fileno())
        return hashlib.file_digest(opened, "sha256").hexdigest()
