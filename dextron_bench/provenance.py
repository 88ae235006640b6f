"""Which code, data and versions made a file, and files that are either whole or not there."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from dextron_bench.world import model

PACKAGES = ("dextron-bench", "mujoco", "dm-control", "numpy", "scipy", "pandas", "pyarrow", "torch", "rerun-sdk")


def collect() -> dict[str, Any]:
    """Code, versions, machine and physics that are at work now, as plain JSON values."""
    return {
        "git": _git("rev-parse", "HEAD"),
        "dirty": None if (changes := _git("status", "--porcelain")) is None else bool(changes),
        "versions": {name: _version(name) for name in PACKAGES},
        "python": platform.python_version(),
        "machine": {"system": platform.platform(), "cpu": _processor(), "cores": os.cpu_count()},
        "physics": model.mjcf_hash(),
    }


def digest(*parts: bytes) -> str:
    """SHA-256 of the parts in order, hexadecimal; each part's length is hashed too."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little"))
        total.update(part)
    return total.hexdigest()


def write_whole(file: Path, write: Callable[[Path], object]) -> None:
    """Lets `write` fill a temporary file, then puts it in place of `file` in one move.

    Killed at any moment, `file` is what it was before or what it is after. Errors leave no temporary file.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    temporary = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        write(temporary)
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        os.replace(temporary, file)
    finally:
        temporary.unlink(missing_ok=True)


def write_json(file: Path, value: Any) -> None:
    """Writes a JSON file whole, with sorted keys."""
    text = json.dumps(value, indent=1, sort_keys=True) + "\n"
    write_whole(file, lambda part: part.write_text(text, encoding="utf-8"))


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _git(*words: str) -> str | None:
    here = Path(__file__).resolve().parent
    if not (here.parent / ".git").exists():
        return None
    try:
        done = subprocess.run(["git", "-C", str(here), *words], capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
