"""Episodes have the same bits with the vector instructions of NumPy, PyTorch and OpenBLAS on and off."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from functools import cache
from typing import Any

import pytest

ROWS = 2
PLAYED = f"""
import json, threadpoolctl
from numpy._core import _multiarray_umath as numpy_build
from dextron_bench import ExpertAgent, load_split, open_source, rollout
from dextron_bench.evaluation.episodes import fingerprint
from dextron_bench.methods.weights import agent_by_name
from dextron_bench.storage import hashing

source, cases = open_source("synthetic"), load_split("synthetic", "test").cases[:{ROWS}]
played = {{}}
for name in ("expert", "bc", "rlil"):
    agent = ExpertAgent() if name == "expert" else agent_by_name(name, "synthetic")[1]
    episodes = dict(rollout(agent, source, cases, threads=1))
    played[name] = [(fingerprint(episodes[row]), len(episodes[row].actions)) for row in range(len(cases))]
paths = [source.path(case.setting) for case in load_split("synthetic", "test").cases[:100]]
poses = hashing.digest(*(array.tobytes() for path in paths for array in (path.positions, path.quaternions)))
kernels = [library["architecture"] for library in threadpoolctl.threadpool_info() if "architecture" in library]
on = [name for name in numpy_build.__cpu_dispatch__ if numpy_build.__cpu_features__[name]]
dispatch = numpy_build.__cpu_dispatch__
print(json.dumps({{"played": played, "poses": poses, "dispatch": dispatch, "on": on, "kernels": kernels}}))
"""


@cache
def played(**variables: str) -> dict[str, Any]:
    """Fingerprints and lengths of a few episodes, played by a new process with these environment variables."""
    answer = subprocess.run(
        [sys.executable, "-c", PLAYED], env=os.environ | variables, capture_output=True, text=True, check=True
    )
    return json.loads(answer.stdout.splitlines()[-1])


def plain() -> dict[str, Any]:
    """The episodes with all vector instructions of this processor."""
    return played(OPENBLAS_NUM_THREADS="1")


@pytest.mark.slow
def test_numpys_vector_instructions_change_no_bit():
    usual = plain()
    if not usual["on"]:
        pytest.skip("NumPy uses no more than its baseline on this processor")
    baseline = played(OPENBLAS_NUM_THREADS="1", NPY_DISABLE_CPU_FEATURES=" ".join(usual["dispatch"]))
    assert baseline["on"] == []
    assert (baseline["played"], baseline["poses"]) == (usual["played"], usual["poses"])
    assert all(length > 50 for episodes in usual["played"].values() for _, length in episodes)


@pytest.mark.thorough
@pytest.mark.skipif(platform.machine() != "x86_64", reason="the name of this kernel is one of x86")
def test_the_kernels_of_openblas_and_pytorch_change_no_bit():
    oldest = played(
        OPENBLAS_NUM_THREADS="1", OPENBLAS_CORETYPE="Prescott", ATEN_CPU_CAPABILITY="default", MKL_CBWR="COMPATIBLE"
    )
    assert oldest["kernels"]
    assert not set(oldest["kernels"]) & set(plain()["kernels"])
    assert (oldest["played"], oldest["poses"]) == (plain()["played"], plain()["poses"])


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the variable is one of glibc")
def test_the_c_librarys_vector_instructions_change_no_pose_of_a_path():
    """They change the last bits of the physics, so that episodes differ (docs/world.md); the hand's path does not."""
    features = "-AVX2,-FMA,-AVX,-FMA4,-AVX2_Usable,-FMA_Usable"
    other = played(OPENBLAS_NUM_THREADS="1", GLIBC_TUNABLES=f"glibc.cpu.hwcaps={features}")
    assert other["poses"] == plain()["poses"]
