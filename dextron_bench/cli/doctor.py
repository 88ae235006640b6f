"""`dextron-bench doctor`: what this machine has of what the benchmark needs."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version

from dextron_bench.cli.output import print_json, print_table
from dextron_bench.reaches import sources
from dextron_bench.reaches.recorded import cache


@dataclass(frozen=True)
class Doctor:
    """Show versions, renderers, devices and data; exit code 1 where something needed is missing.

    Example: dextron-bench doctor
    """

    json: bool = False
    """Print JSON, one object for each finding."""

    def __call__(self) -> int:
        from dextron_bench.cli.doctor import examine

        findings = list(examine())
        if self.json:
            print_json([asdict(finding) for finding in findings])
        else:
            signs = {(True, True): "yes", (True, False): "yes", (False, True): "MISSING", (False, False): "no"}
            rows = [(f.what, signs[f.found, f.needed], f.detail) for f in findings]
            print_table("dextron-bench on this machine", ["what", "there", "detail"], rows)
        return 0 if all(finding.found for finding in findings if finding.needed) else 1


PACKAGES = (
    *("mujoco", "dm-control", "gymnasium", "numpy", "scipy", "torch", "safetensors"),
    *("pandas", "pyarrow", "rerun-sdk", "matplotlib", "tyro", "rich"),
)


RENDERERS = ("egl", "osmesa", "glfw")


PATIENCE = 30.0  # [s] for one renderer.


RENDER = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 64, 64).render()"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing looked at: whether it is there, whether the benchmark needs it, and what was found."""

    what: str
    found: bool
    needed: bool
    detail: str


def examine() -> Iterator[Finding]:
    """Looks at one thing after the other."""
    yield Finding("python", sys.version_info >= (3, 11), True, platform.python_version())
    for package in PACKAGES:
        yield _package(package)
    yield Finding("processors", True, True, str(os.cpu_count()))
    yield _cuda()
    for name in RENDERERS:
        yield _renderer(name)
    for name in sources.SOURCES:
        yield _source(name)


def _package(name: str) -> Finding:
    try:
        return Finding(name, True, True, version(name))
    except PackageNotFoundError:
        return Finding(name, False, True, f"not installed; pip install {name}")


def _cuda() -> Finding:
    try:
        import torch
    except ImportError as error:
        return Finding("cuda", False, False, str(error))
    if not torch.cuda.is_available():
        return Finding("cuda", False, False, "no device; networks train on the processor")
    return Finding("cuda", True, False, torch.cuda.get_device_name())


def _renderer(name: str) -> Finding:
    """Tries a GL back end in a process of its own, which is all that it can crash."""
    environment = {**os.environ, "MUJOCO_GL": name}
    try:
        done = subprocess.run(
            [sys.executable, "-c", RENDER], env=environment, capture_output=True, text=True, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired:
        return Finding(f"MUJOCO_GL={name}", False, False, f"no answer in {PATIENCE:.0f} s")
    lines = done.stderr.strip().splitlines()
    detail = "renders" if done.returncode == 0 else (lines[-1] if lines else f"ended with {done.returncode}")
    return Finding(f"MUJOCO_GL={name}", done.returncode == 0, False, detail)


def _source(name: str) -> Finding:
    needed = name != "real"
    try:
        reaches = sources.open_source(name).names
    except (LookupError, ValueError, ImportError, OSError) as error:
        return Finding(f"reaches {name}", False, needed, str(error))
    where = f", cache {cache.cache_file()}" if name == "real" else ""
    return Finding(f"reaches {name}", True, needed, f"{len(reaches)}{where}")
