"""An environment in which programs count many processors."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent / "conditions" / "many_processors.c"


def environment(folder: Path, count: int) -> dict[str, str]:
    """The environment of a program that counts `count` processors; skips the test where none can be made."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if os.uname().sysname != "Linux" or not compiler:
        pytest.skip("a library that answers for the system needs Linux and a C compiler")
    library = folder / "many_processors.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, SOURCE], check=True)
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS", "MALLOC_ARENA_MAX")
    others = {name: value for name, value in os.environ.items() if name not in threads}
    return {**others, "LD_PRELOAD": str(library), "PROCESSORS": str(count)}
