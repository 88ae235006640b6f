"""Provenance: the code, versions and machine that make a file."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

PACKAGES = ("dextron-bench", "mujoco", "dm-control", "numpy", "scipy", "pandas", "pyarrow", "torch", "rerun-sdk")
# Names in /proc/cpuinfo.
VECTORS = re.compile(r"ssse3|sse\w*|avx\w*|fma4?|f16c|xop|amx\w*|neon|asimd\w*|sve\w*|sme(2\w*|[a-z]+\d\w*)?")


def collect(physics: str) -> dict[str, Any]:
    """Code, versions and machine of this process, and the hash of its physics, as plain JSON values."""
    return {
        "git": _git("rev-parse", "HEAD"),
        "dirty": None if (changes := _git("status", "--porcelain")) is None else bool(changes),
        "versions": {name: _version(name) for name in PACKAGES},
        "python": platform.python_version(),
        "machine": {
            "system": platform.platform(),
            "cpu": _cpu_info("model name") or platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "vector_extensions": vector_extensions(),
        },
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


def vector_extensions() -> list[str] | None:
    """Names of the processor's vector instructions, sorted; None where the system does not list them.

    The last bits of results may depend on them. Files of earlier versions do not have this entry.
    """
    features = _cpu_info("flags") or _cpu_info("Features")  # The name on x86, and on ARM.
    return sorted(filter(VECTORS.fullmatch, features.split())) if features else None


def _cpu_info(name: str) -> str:
    """The first entry of that name in /proc/cpuinfo; empty if there is none."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    entries = (line.split(":", 1)[1].strip() for line in lines if line.split(":")[0].strip() == name and ":" in line)
    return next(entries, "")
