"""Provenance: the code, versions and machine that make a file."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("dextron-bench", "mujoco", "dm-control", "numpy", "scipy", "pandas", "pyarrow", "torch", "rerun-sdk")


def collect(physics: str) -> dict[str, Any]:
    """Code, versions and machine of this process, and the hash of its physics, as plain JSON values."""
    return {
        "git": _git("rev-parse", "HEAD"),
        "dirty": None if (changes := _git("status", "--porcelain")) is None else bool(changes),
        "versions": {name: _version(name) for name in PACKAGES},
        "python": platform.python_version(),
        "machine": {"system": platform.platform(), "cpu": _processor(), "cores": os.cpu_count()},
        "physics": physics,
    }


def physics_of(result: dict[str, Any]) -> str:
    """The hash of the physics with which the episodes of a result were played; empty if it does not say."""
    return str((result.get("provenance") or {}).get("physics") or "")


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _git(*arguments: str) -> str | None:
    package = Path(__file__).resolve().parents[1]
    if not (package.parent / ".git").exists():
        return None
    try:
        process = subprocess.run(
            ["git", "-C", str(package), *arguments], capture_output=True, text=True, timeout=10, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return process.stdout.strip()


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
