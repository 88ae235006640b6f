"""SHA-256 of bytes and of files."""

from __future__ import annotations

import hashlib
from pathlib import Path


def digest(*parts: bytes) -> str:
    """SHA-256 of the parts in order, hexadecimal; the hash includes the length of each part."""
    hasher = hashlib.sha256()
    for part in parts:
        hasher.update(len(part).to_bytes(8, "little"))
        hasher.update(part)
    return hasher.hexdigest()


def sha256(file: Path) -> str:
    """SHA-256 of a file's content, hexadecimal; raises OSError."""
    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()
