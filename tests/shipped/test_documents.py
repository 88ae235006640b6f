"""Documents: their Python code parses, and every name of the package that it uses exists."""

from __future__ import annotations

import ast
import importlib
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

from tools import documents
from tools.rebuild import DOCUMENTS

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^```(?:python|py)\b[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCKS = [
    pytest.param(block, id=f"{file.relative_to(ROOT)}-{number}")
    for file in FILES
    for number, block in enumerate(FENCE.findall(file.read_text(encoding="utf-8")))
    if "dextron_bench" in block or "baselines" in block  # Others may be fragments.
]


def is_ours(module: str) -> bool:
    return module.partition(".")[0] in ("dextron_bench", "baselines")


def missing_names(tree: ast.Module) -> Iterator[str]:
    """Names of the package that code imports, or uses as attributes of an imported module, and that do not exist."""
    modules = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and is_ours(node.module):
            module = importlib.import_module(node.module)
            for alias in node.names:
                try:
                    value = getattr(module, alias.name, None) or importlib.import_module(f"{node.module}.{alias.name}")
                except ModuleNotFoundError:
                    yield f"{node.module}.{alias.name}"
                else:
                    modules[alias.asname or alias.name] = value
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            owner = modules.get(node.value.id)
            if type(owner).__name__ == "module" and not hasattr(owner, node.attr):
                yield f"{node.value.id}.{node.attr}"


@pytest.mark.parametrize("block", BLOCKS)
def test_code_in_documents_uses_names_that_exist(block: str):
    assert list(missing_names(ast.parse(textwrap.dedent(block)))) == []


def test_a_renamed_function_is_noticed():
    code = "from dextron_bench import rollouts\nfrom dextron_bench.evaluation import diagnosis\ndiagnosis.table(1)"
    assert list(missing_names(ast.parse(code))) == ["dextron_bench.rollouts", "diagnosis.table"]


@pytest.mark.slow
def test_numbers_in_the_documents_are_those_of_the_data(tmp_path: Path):
    """The same files as `dextron-bench rebuild` fills; at least the two pages with most numbers have some."""
    files = [file for pattern in DOCUMENTS for file in sorted(ROOT.glob(pattern))]
    copies = {file: tmp_path / str(number) for number, file in enumerate(files)}
    for file, copy in copies.items():
        copy.write_bytes(file.read_bytes())
    changed = documents.fill(copies.values(), ROOT / "leaderboard")
    assert [file for file, copy in copies.items() if copy in changed] == []
    with_numbers = {file.name for file in files if documents.NUMBER.search(file.read_text(encoding="utf-8"))}
    assert {"baselines.md", "monte-carlo.md"} <= with_numbers
