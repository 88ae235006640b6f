"""Provenance: the code, versions and machine that make a file."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from msgspec import UNSET, UnsetType, field
from msgspec.structs import replace

from dextron_bench.processes import programs
from dextron_bench.storage import atomic, hashing
from dextron_bench.storage.folders import visible
from dextron_bench.storage.records import Amount, Count, Record

PACKAGES = ("dextron-bench", "mujoco", "dm-control", "numpy", "scipy", "pandas", "pyarrow", "torch", "rerun-sdk")
PLAYING = ("reaches", "world", "experts", "splits", "methods", "evaluation")  # Packages that episodes follow from.
REACHES = "data/synthetic-reaches.npz"  # The file that synthetic reaches follow from.
# Names in /proc/cpuinfo.
VECTORS = re.compile(r"ssse3|sse\w*|avx\w*|fma4?|f16c|xop|amx\w*|neon|asimd\w*|sve\w*|sme(2\w*|[a-z]+\d\w*)?")


class Machine(Record, frozen=True):
    """The machine that made a file. Files of earlier versions do not have its vector extensions."""

    system: str = ""
    cpu: str = ""
    cores: Count | UnsetType | None = UNSET
    vector_extensions: list[str] | UnsetType | None = UNSET

    @property
    def extensions(self) -> list[str] | None:
        """The names of its vector instructions; None if they are not known."""
        return None if self.vector_extensions is UNSET else self.vector_extensions


class Provenance(Record, frozen=True):
    """The process that made a file, and the `others` if several made it. `physics` is the hash of its physics.

    `seconds` is the time of a training.
    """

    git: str | UnsetType | None = UNSET
    dirty: bool | UnsetType | None = UNSET
    versions: dict[str, str | None] = field(default_factory=dict)
    python: str = ""
    machine: Machine = Machine()
    physics: str = ""
    seconds: Amount | None = None
    others: tuple[Provenance, ...] = ()


def collect(physics: str) -> Provenance:
    """Code, versions and machine of this process, and the hash of its physics."""
    changes = _git("status", "--porcelain")
    return Provenance(
        git=_git("rev-parse", "HEAD"),
        dirty=None if changes is None else bool(changes),
        versions={name: version_of(name) for name in PACKAGES},
        python=platform.python_version(),
        machine=Machine(
            platform.platform(),
            _cpu_info("model name") or platform.processor() or platform.machine(),
            os.cpu_count(),
            vector_extensions(),
        ),
        physics=physics,
    )


def merged(makers: Iterable[Provenance]) -> Provenance:
    """The provenance of a file that several processes made: one of them, and under `others` the rest, without doubles.

    It does not depend on the order of the processes. Processes of one machine with equal versions count as one.
    """
    processes = (replace(one, others=()) for maker in makers for one in (maker, *maker.others))
    distinct = {atomic.json_text(one): one for one in processes}
    first, *others = (distinct[text] for text in sorted(distinct))
    return replace(first, others=tuple(others))


def platform_of(maker: Provenance) -> str:
    """What the last bits of episodes may depend on: the system, the processor with its instructions, and MuJoCo."""
    machine = maker.machine
    extensions = hashing.digest(" ".join(machine.extensions or ()).encode())[:8]
    return f"{system_of(machine)}, {machine.cpu} ({extensions}), MuJoCo {maker.versions.get('mujoco')}"


def system_of(machine: Machine) -> str:
    """The name of the operating system."""
    return machine.system.partition("-")[0]


def code_hash(*more: Path) -> str:
    """SHA-256 of the code that episodes follow from, and of more files, such as a method's."""
    return hashing.digest(_code_hash().encode(), *(part for file in more for part in (file.name.encode(), _sha(file))))


@cache
def _code_hash() -> str:
    package = Path(__file__).parents[1]
    files = [file for name in PLAYING for end in ("py", "xml") for file in visible(package / name, f"**/*.{end}")]
    names = [file.relative_to(package).as_posix() for file in files]
    parts = (part for name, file in zip(names, files, strict=True) for part in (name.encode(), _sha(file)))
    return hashing.digest(*parts, _sha(package / REACHES))


def _sha(file: Path) -> bytes:
    return hashing.sha256(file).encode()


def version_of(name: str) -> str | None:
    """The version of an installed package; None if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _git(*arguments: str) -> str | None:
    package = Path(__file__).resolve().parents[1]
    git = programs.find("git")
    if git is None or not (package.parent / ".git").exists():
        return None
    try:
        process = subprocess.run(
            [git, "-C", str(package), *arguments],
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return process.stdout.strip()


def vector_extensions() -> list[str] | None:
    """Names of the processor's vector instructions, sorted; None where the system does not list them.

    The last bits of results may depend on them.
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
