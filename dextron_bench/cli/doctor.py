"""`dextron-bench doctor`: reports whether this machine has what the benchmark needs."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version

from dextron_bench.cli.support.exit_codes import DIFFERS, DONE
from dextron_bench.cli.support.output import print_json, print_table
from dextron_bench.processes import programs


@dataclass(frozen=True)
class Doctor:
    """Show versions, renderers, devices and data; exit with code 1 if something is missing that the benchmark needs.

    Example: dextron-bench doctor
    """

    json: bool = False
    """Print JSON, one object for each finding."""

    def __call__(self) -> int:
        findings = list(examine())
        if self.json:
            print_json([asdict(finding) for finding in findings])
        else:
            rows = [(finding.what, finding.status, finding.detail) for finding in findings]
            print_table("dextron-bench on this machine", ["what", "available", "detail"], rows)
        return DONE if all(finding.found for finding in findings if finding.needed) else DIFFERS


PACKAGES = (
    "mujoco",
    "dm-control",
    "gymnasium",
    "numpy",
    "scipy",
    "torch",
    "safetensors",
    "pandas",
    "pyarrow",
    "rerun-sdk",
    "matplotlib",
    "pillow",
    "tyro",
    "rich",
    "msgspec",
    "threadpoolctl",
)
EXTRAS = {  # By package: the extra that installs it.
    "minari": "minari",
    "av": "video",
    "onnxruntime": "onnx",
    "optuna": "sweep",
    "mlflow-skinny": "mlflow",
    "tensorboard": "tensorboard",
    "trackio": "trackio",
    "wandb": "wandb",
    "ray": "cluster",
}
RENDERERS = ("egl", "osmesa", "glfw")
TIMEOUT = 120.0  # [s] for one renderer.
RENDER = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 64, 64).render()"


@dataclass(frozen=True, slots=True)
class Finding:
    """One check: `found` if the thing is available, `needed` if the benchmark needs it."""

    what: str
    found: bool
    needed: bool
    detail: str

    @property
    def status(self) -> str:
        """The result in one word."""
        if self.found:
            return "yes"
        return "MISSING" if self.needed else "no"


def examine() -> Iterator[Finding]:
    """Checks one thing after another."""
    yield Finding("python", sys.version_info >= (3, 11), True, platform.python_version())
    for package in PACKAGES:
        yield _package(package)
    for package, extra in EXTRAS.items():
        yield _package(package, extra)
    yield _sandbox()
    yield Finding("processors", True, True, str(os.cpu_count()))
    yield _cuda()
    for name in RENDERERS:
        yield _renderer(name)
    from dextron_bench.reaches.sources import SOURCES

    for name in SOURCES:
        yield _source(name)


def _package(name: str, extra: str = "") -> Finding:
    """A package and its version; one of an extra is not needed."""
    try:
        return Finding(name, True, not extra, version(name))
    except PackageNotFoundError:
        wanted = f"'dextron-bench[{extra}]'" if extra else name
        return Finding(name, False, not extra, f"not installed; pip install {wanted}")


def _sandbox() -> Finding:
    from dextron_bench.methods.isolation import sandbox

    if sandbox.is_available():
        return Finding("bubblewrap", True, False, "agents of strangers run in a sandbox")
    return Finding("bubblewrap", False, False, "without this sandbox, agents of strangers run only with --trust")


def _cuda() -> Finding:
    try:
        import torch
    except ImportError as error:
        return Finding("cuda", False, False, str(error))
    if not torch.cuda.is_available():
        return Finding("cuda", False, False, "no device; networks train on the processor")
    return Finding("cuda", True, False, torch.cuda.get_device_name())


def _renderer(name: str) -> Finding:
    """Tries a GL back end in a separate process, because it may crash."""
    environment = {**os.environ, "MUJOCO_GL": name}
    try:
        process = subprocess.run(
            programs.python("-c", RENDER), env=environment, capture_output=True, timeout=TIMEOUT, check=False
        )
    except subprocess.TimeoutExpired:
        return Finding(f"MUJOCO_GL={name}", False, False, f"no answer in {TIMEOUT:.0f} s")
    lines = process.stderr.decode(errors="replace").strip().splitlines()
    detail = "renders" if process.returncode == 0 else (lines[-1] if lines else f"exit code {process.returncode}")
    return Finding(f"MUJOCO_GL={name}", process.returncode == 0, False, detail)


def _source(name: str) -> Finding:
    from dextron_bench.reaches import sources  # Loads SciPy, which help does not need.
    from dextron_bench.reaches.recorded import cache

    needed = name != "real"
    try:
        reaches = sources.open_source(name).names
    except (LookupError, ValueError, ImportError, OSError) as error:
        return Finding(f"reaches {name}", False, needed, str(error))
    location = f", {cache.imported() or 'DEXTRON_DATA'}" if name == "real" else ""
    return Finding(f"reaches {name}", True, needed, f"{len(reaches)}{location}")
