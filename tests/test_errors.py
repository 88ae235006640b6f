"""Every error of the package is a DextronError, which the command line prints; any other exception is a defect."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator
from pathlib import Path

import pytest

from dextron_bench.cli import main
from dextron_bench.cli.support.exit_codes import BUG, USAGE
from dextron_bench.errors import BadInput, DextronError, Failed, MissingPackage, NotFound

ROOT = Path(__file__).parents[1]
TEMPLATES = ROOT / "dextron_bench" / "submissions" / "template"  # Files of an agent, which do not import the package.
EXCEPTIONS = {name for name, kind in vars(builtins).items() if isinstance(kind, type) and issubclass(kind, Exception)}


def classes() -> Iterator[tuple[str, set[str]]]:
    """The place of each class of the package and of the baselines that has an exception as a base, and its bases."""
    for file in sorted([*(ROOT / "dextron_bench").rglob("*.py"), *(ROOT / "baselines").rglob("*.py")]):
        if TEMPLATES not in file.parents:
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ClassDef):
                    bases = {ast.unparse(base).rpartition(".")[2] for base in node.bases}
                    if bases & EXCEPTIONS:
                        yield f"{file.relative_to(ROOT)}:{node.name}", bases


@pytest.mark.slow
def test_no_exception_of_python_has_a_direct_child_that_is_not_a_dextron_error():
    bases_of = dict(classes())
    assert "dextron_bench/errors.py:BadInput" in bases_of
    bases_of.pop("dextron_bench/errors.py:DextronError")
    assert [place for place, bases in bases_of.items() if "DextronError" not in bases] == []


@pytest.mark.parametrize(
    ("kind", "python"),
    [(BadInput, ValueError), (NotFound, LookupError), (Failed, RuntimeError), (MissingPackage, ImportError)],
)
def test_each_kind_is_also_the_exception_of_python_that_a_caller_expects(
    kind: type[DextronError], python: type[Exception]
):
    assert issubclass(kind, python)
    assert main.explain(kind("use another  one")) == (USAGE, "use another one")


def test_an_error_of_python_is_a_defect_and_the_message_names_it():
    code, line = main.explain(ValueError("of something"))
    assert code == BUG
    assert "unexpected ValueError: of something" in line
