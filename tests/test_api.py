"""The public API: every name resolves, and none loads more than it needs."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import dextron_bench

HEAVY = {"mujoco", "torch", "pandas", "rerun", "matplotlib", "scipy"}
NEEDED = {  # What the first use of a name may load; all other names may load everything but Rerun and matplotlib.
    "Agent": set(),
    "Expert": {"mujoco", "scipy"},
    "ExpertAgent": {"mujoco", "scipy"},
    "Learner": set(),
    "Perceptron": set(),
    "SuccessModel": {"mujoco", "scipy"},
    "TrainingSetup": set(),
    "Trainer": set(),
    "__version__": set(),
}
SCRIPT = "import sys, dextron_bench; dextron_bench.{name}; print(*sys.modules)"


def loaded(script: str) -> set[str]:
    """Names of the modules that a script has loaded in a fresh process."""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("name", dextron_bench.__all__)
def test_every_public_name_resolves(name: str):
    assert getattr(dextron_bench, name) is not None


def test_the_listed_names_are_the_loaded_ones():
    """The list for type checkers, `__all__` and the table of modules name the same things."""
    tree = ast.parse(Path(inspect.getfile(dextron_bench)).read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    typed = {
        alias.asname or alias.name
        for node in ast.walk(block)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed | {"__version__"} == set(dextron_bench.__all__) == dextron_bench._HOMES.keys() | {"__version__"}


def test_an_earlier_name_answers_with_the_new_one():
    with pytest.warns(DeprecationWarning, match="Track is now TrainingSetup"):
        assert dextron_bench.Track is dextron_bench.TrainingSetup  # pyright: ignore[reportAttributeAccessIssue]


def test_the_import_of_the_package_loads_nothing_heavy():
    assert not HEAVY & loaded("import sys, dextron_bench; print(*sys.modules)")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(NEEDED))
def test_a_name_loads_no_more_than_it_needs(name: str):
    modules = loaded(SCRIPT.format(name=name))
    assert not (HEAVY & modules) - NEEDED[name]
    assert "dextron_bench.world.engine" not in modules


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(dextron_bench.__all__) - NEEDED.keys() - {"read_recording"}))
def test_no_other_name_loads_viewer_or_plots(name: str):
    assert not {"rerun", "matplotlib"} & loaded(SCRIPT.format(name=name))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no public name 'rollouts'"):
        _ = dextron_bench.rollouts  # type: ignore[attr-defined]
