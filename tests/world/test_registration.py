"""Registration with Gymnasium: by import, by the id alone, and for vectors, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys

import pytest

ID = "dextron_bench/Grasp-v0"
SINGLE, VECTOR = "GraspEnv", "GraspVectorEnv"


def printed(code: str) -> str:
    """What a fresh interpreter prints for some code, in which any warning is an error."""
    words = [sys.executable, "-W", "error::UserWarning", "-c", code]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize(
    "code",
    [
        f"import dextron_bench, gymnasium; env = gymnasium.make('{ID}', reaches='minjerk')",
        f"import gymnasium, dextron_bench; env = gymnasium.make('{ID}', reaches='minjerk')",
        f"import gymnasium; env = gymnasium.make('dextron_bench:{ID}', reaches='minjerk')",
    ],
    ids=["import first", "import last", "id with module"],
)
def test_make_knows_the_environment(code: str):
    assert printed(f"{code}; print(type(env.unwrapped).__name__, env.spec.id)") == f"{SINGLE} {ID}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "code",
    [
        f"import dextron_bench, gymnasium; env = gymnasium.make_vec('{ID}', num_envs=2, reaches='minjerk')",
        f"import gymnasium; env = gymnasium.make_vec('dextron_bench:{ID}', num_envs=2, reaches='minjerk')",
    ],
    ids=["import", "id with module"],
)
def test_make_vec_makes_the_environment_of_many_episodes(code: str):
    assert printed(f"{code}; print(type(env.unwrapped).__name__, env.num_envs)") == f"{VECTOR} 2"


def test_the_import_of_the_package_leaves_the_heavy_libraries_out():
    heavy = ("mujoco", "dm_control", "torch", "pandas", "scipy", "rerun", "matplotlib")
    code = f"import sys, dextron_bench; print([name for name in {heavy} if name in sys.modules])"
    assert printed(code) == "[]"


def test_the_import_of_the_package_changes_no_import_of_others():
    code = "import sys, gymnasium; before = list(sys.meta_path); import dextron_bench; print(sys.meta_path == before)"
    assert printed(code) == "True"
