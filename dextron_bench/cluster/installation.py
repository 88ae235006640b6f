"""What a result depends on in an installation: code, data and packages. All nodes of a cluster must have the same."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from dextron_bench.cluster.tasks import OtherVersion
from dextron_bench.storage import hashing, provenance
from dextron_bench.storage.folders import visible

PACKAGES = ("mujoco", "numpy", "scipy", "pandas", "pyarrow", "torch")  # Bits of episodes and of files follow from them.
SUFFIXES = (".py", ".xml")


@cache
def version() -> dict[str, str | None]:
    """SHA-256 of the code and of the shipped data, and the versions of Python and of packages, by name."""
    package = Path(__file__).parents[1]
    files = [file for file in visible(package, "**/*") if file.is_file() and "__pycache__" not in file.parts]
    data = [file for file in files if file.is_relative_to(package / "data")]
    code = [file for file in files if file.suffix in SUFFIXES and file not in data]
    return {
        "code": _hash(code, package),
        "data": _hash(data, package),
        "Python": platform.python_version(),
        **{name: provenance.version_of(name) for name in PACKAGES},
    }


def check(expected: Mapping[str, str | None], node: str) -> None:
    """Raises OtherVersion if this installation, on a node, differs from the version of the driver."""
    differing = [name for name, value in version().items() if expected.get(name) != value]
    if differing:
        raise OtherVersion(
            f"node {node} has another version than this machine: it differs in {' and '.join(differing)}; install the "
            "same on all nodes"
        )


def _hash(files: list[Path], package: Path) -> str:
    parts = ((file.relative_to(package).as_posix(), hashing.sha256(file)) for file in files)
    return hashing.digest(*(text.encode() for part in parts for text in part))
