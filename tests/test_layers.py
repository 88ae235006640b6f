"""The table of layers, import by import: a package imports only packages of the levels below it."""

from __future__ import annotations

import ast
import graphlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import dextron_bench

ROOT = Path(__file__).parents[1]
LEVELS = {
    "processes": 0,
    "storage": 1,
    "reaches": 2,
    "web": 2,
    "world": 3,
    "experts": 4,
    "splits": 5,
    "methods": 5,
    "evaluation": 6,
    "recording": 7,
    "success": 7,
    "training": 7,
    "runs": 8,
    "scores": 8,
    "tracking": 8,
    "baselines": 8,
    "catalogue": 9,
    "submissions": 9,
    "sweeps": 9,
    "leaderboard": 10,
    "cluster": 11,
    "cli": 12,
}
SDKS = {  # Packages of others that one place alone imports.
    "rerun": "dextron_bench/recording/",
    "rerun_bindings": "dextron_bench/recording/",
    "mujoco": "dextron_bench/world/simulator.py",
    "dm_control": "dextron_bench/world/suite.py",
    "matplotlib": "dextron_bench/scores/figures/",
    "minari": "dextron_bench/evaluation/minari_export.py",
    "av": "dextron_bench/recording/film.py",
    "tensorboard": "dextron_bench/tracking/to_tensorboard.py",
    "trackio": "dextron_bench/tracking/to_wandb.py",
    "wandb": "dextron_bench/tracking/to_wandb.py",
    "tyro": "dextron_bench/cli/",
    "rich": "dextron_bench/cli/",
    "ray": "dextron_bench/cluster/ray_cluster.py",
    "mlflow": "dextron_bench/catalogue/mlflow_export.py",
    "optuna": "dextron_bench/sweeps/optuna_search.py",
}
TOP = ("dextron_bench/__init__.py", "dextron_bench/__main__.py")  # Above all levels.
PUBLIC = ("world.gym", "world.suite", "world.model", "world.task", "success.network")  # Public modules.
BASELINES_ALSO = {  # Private modules that baselines import, and why an outside entrant needs none of them.
    "experts.openings": "closings tried in forks of the batched engine",
    "methods.exact": "rounding of an output that is not a perceptron's",
    "methods.learners": "the type of named arrays",
    "reaches.reach": "the type of a path",
    "reaches.rotation": "features of poses; SciPy has rotations too",
    "reaches.setting": "the type of a source",
    "reaches.timing": "the duration of a control step",
    "reaches.synthetic.fitted": "STOPPING learns from new reaches of a model of `train`",
    "reaches.sources": "names of the sources for which weights can ship",
    "storage.atomic": "the caches of demonstrations and openings",
    "storage.hashing": "the cache of demonstrations, and the hash of a success model",
    "storage.tensors": "a success model in a file",
    "world.engine": "SAC trains on the batched engine; Gymnasium's vector environment offers the same",
}
FILES = sorted(file for folder in ("dextron_bench", "baselines") for file in (ROOT / folder).rglob("*.py"))


def imports(file: Path) -> Iterator[str]:
    """Dotted names of the modules that a file imports anywhere, and of the names that it imports from them."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file} has a relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def package(name: str) -> str:
    """The package of the table that a dotted name belongs to; empty for other names."""
    first, _, rest = name.partition(".")
    if first == "baselines":
        return first
    return rest.partition(".")[0] if first == "dextron_bench" else ""


def faults(file: str, names: Iterator[str] | list[str]) -> list[str]:
    """Imports of a file that go up or sideways, or reach a package of others that has another home."""
    here, problems = package(file.removesuffix(".py").replace("/", ".")), []
    for name in names:
        there = package(name)
        if there == "baselines" and here != there:
            problems.append(f"{file} imports {name}: no part of the benchmark imports its entrants")
        elif there in LEVELS and file not in TOP and here != there and LEVELS[there] >= LEVELS[here]:
            problems.append(f"{file} imports {name}: {here} is level {LEVELS[here]}, {there} is level {LEVELS[there]}")
        if name == f"dextron_bench.{here}" or (name.rpartition(".")[0] == f"dextron_bench.{here}" and _of_init(name)):
            problems.append(f"{file} imports its own package's __init__.py")
        if here == "baselines" and name.startswith("dextron_bench.") and not _is_open_to_baselines(name):
            problems.append(f"{file} imports {name}, which is private")
        if here != "baselines" and file not in TOP and name.removeprefix("dextron_bench.") in dextron_bench.__all__:
            problems.append(f"{file} imports {name} through the public API; import its module")
        home = SDKS.get(name.partition(".")[0])
        if home and not file.startswith(home):
            problems.append(f"{file} imports {name}, whose home is {home}")
    return problems


def _is_open_to_baselines(name: str) -> bool:
    path = name.removeprefix("dextron_bench.")
    modules = (*PUBLIC, *BASELINES_ALSO)
    return path in dextron_bench.__all__ or path in modules or path.rpartition(".")[0] in modules


def _of_init(name: str) -> bool:
    """True if a dotted name is no module: then the package's `__init__.py` offers it."""
    place = ROOT / name.replace(".", "/")
    return not place.is_dir() and not place.with_suffix(".py").exists()


@pytest.mark.parametrize("file", [str(file.relative_to(ROOT)) for file in FILES])
def test_a_package_imports_only_from_the_levels_below(file: str):
    assert faults(file, imports(ROOT / file)) == []


def test_every_package_has_a_level():
    folders = {place.name for place in (ROOT / "dextron_bench").iterdir() if (place / "__init__.py").exists()}
    assert folders == LEVELS.keys() - {"baselines"}


@pytest.mark.parametrize(
    ("file", "name", "fault"),
    [
        (
            "dextron_bench/world/task.py",
            "dextron_bench.experts.policies.Expert",
            "world is level 3, experts is level 4",
        ),
        ("dextron_bench/splits/loading.py", "dextron_bench.methods.registry", "splits is level 5, methods is level 5"),
        ("dextron_bench/cli/run.py", "baselines.rl", "no part of the benchmark imports its entrants"),
        ("baselines/rl.py", "dextron_bench.rollout", None),
        ("baselines/rl.py", "dextron_bench.runs.plans.Plan", "which is private"),
        ("dextron_bench/cli/run.py", "dextron_bench.rollout", "through the public API"),
        ("dextron_bench/runs/plans.py", "dextron_bench.scores.paired", "runs is level 8, scores is level 8"),
        ("dextron_bench/scores/paired.py", "rerun.chunk", "whose home is dextron_bench/recording/"),
        ("dextron_bench/recording/pair.py", "dextron_bench.recording.read", "its own package's __init__.py"),
    ],
)
def test_a_fault_is_noticed(file: str, name: str, fault: str | None):
    problems = faults(file, [name])
    assert any(fault in problem for problem in problems) if fault else not problems


def test_no_modules_import_each_other_in_a_circle():
    """At module level; an import inside a function, or for type checkers alone, closes no circle outside `cli/`."""
    modules = {file.relative_to(ROOT).with_suffix("").as_posix().replace("/", "."): file for file in FILES}
    graph = {name: {target for target in _imports(file) if target in modules} for name, file in modules.items()}
    order = list(graphlib.TopologicalSorter(graph).static_order())  # Raises CycleError, which names the circle.
    assert set(order) == modules.keys()


def _imports(file: Path) -> Iterator[str]:
    """Modules that a file imports when it is loaded; in `cli/` all that it imports, with those for type checkers."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    is_cli = "cli" in file.relative_to(ROOT).parts
    for node in ast.walk(tree) if is_cli else tree.body:
        if isinstance(node, ast.ImportFrom):
            yield from (node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names))
