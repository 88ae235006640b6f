"""Plain English: no banned words in docstrings, comments, messages and documents, and no empty names of variables."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CODE = ("dextron_bench", "baselines", "tests", "examples")
DOCUMENTS = (
    *("README.md", "CONTRIBUTING.md", "leaderboard/README.md", "recordings/README.md", "docs/**/*.md"),
    *("dextron_bench/**/*.html", "dextron_bench/**/*.js"),
)
TO_DO: tuple[str, ...] = ()  # Folders and files that are not rewritten yet.

# Each pattern with a plain replacement.
BANNED = {
    r"foret(?:ell|old)\w*": "predict",
    r"judg\w*": "evaluate, metrics",
    r"whence|whither": "from where, to where",
    r"that of|those of": "repeat the noun",
    r"of which|by which": "two sentences",
    r"in place of": "instead of, replaces",
    r"it is to be": "must be",
    r"tell|tells|told|telling": "report, show, print, describe; distinguish",
    r"let alone": "two sentences",
    r"at hand": "available",
}
PATTERN = re.compile("|".join(rf"\b(?:{words})\b".replace(" ", r"\s+") for words in BANNED), re.IGNORECASE)
NAMES = {"found", "told", "own", "each"}  # They say nothing about their content.


def text_faults(text: str, line: int = 1) -> Iterator[tuple[int, str]]:
    """Line and banned words in a text that starts at a line of its file."""
    for match in PATTERN.finditer(text):
        yield line + text.count("\n", 0, match.start()), f"{' '.join(match[0].split())!r}"


def code_faults(source: str) -> Iterator[tuple[int, str]]:
    """Line and fault of banned words in docstrings, messages and comments, and of empty names."""
    yield from _string_faults(ast.parse(source))
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield from text_faults(token.string, token.start[0])
    for node in _outside_class_bodies(ast.parse(source)):
        name = _bound_name(node)
        if name in NAMES:
            yield getattr(node, "lineno", 1), f"the name {name!r}"


def _string_faults(node: ast.AST) -> Iterator[tuple[int, str]]:
    """Faults in string literals with several words; an f-string is one text, with its values left out."""
    if isinstance(node, ast.JoinedStr):
        parts = (part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
        yield from text_faults("".join(map(str, parts)), node.lineno)
        children = [part for part in node.values if not isinstance(part, ast.Constant)]
    else:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            yield from text_faults(node.value, node.lineno)
        children = list(ast.iter_child_nodes(node))
    for child in children:
        yield from _string_faults(child)


def _outside_class_bodies(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes except fields of classes, which may be keys of published files."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not (isinstance(node, ast.ClassDef) and isinstance(child, ast.Assign | ast.AnnAssign)):
            yield from _outside_class_bodies(child)


def _bound_name(node: ast.AST) -> str | None:
    """The name of a variable, argument or function where it is bound; None for all other nodes."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        return node.id
    if isinstance(node, ast.arg):
        return node.arg
    return node.name if isinstance(node, ast.FunctionDef | ast.ExceptHandler) else None


@cache
def faults() -> list[str]:
    """All faults of the project as `file:line: fault`."""
    return list(_faults())


def _faults() -> Iterator[str]:
    for folder in CODE:
        for file in sorted((ROOT / folder).rglob("*.py")):
            if file != Path(__file__):
                yield from _located(file, code_faults(file.read_text(encoding="utf-8")))
    for pattern in DOCUMENTS:
        for file in sorted(ROOT.glob(pattern)):
            yield from _located(file, text_faults(file.read_text(encoding="utf-8")))


def _located(file: Path, file_faults: Iterator[tuple[int, str]]) -> Iterator[str]:
    return (f"{file.relative_to(ROOT)}:{line}: {fault}" for line, fault in sorted(set(file_faults)))


def test_the_english_is_plain():
    remaining = [fault for fault in faults() if not fault.startswith(TO_DO)]
    assert not remaining, "\n".join(["plain words are needed here:", *remaining])


def test_what_is_done_is_not_on_the_list():
    assert [name for name in TO_DO if not any(fault.startswith(name) for fault in faults())] == []


@pytest.mark.parametrize(
    ("source", "fault"),
    [
        ('"""What is foretold."""', (1, "'foretold'")),
        ('"""One line.\n\nThe mean of A less that\nof B."""', (3, "'that of'")),
        ("x = 1  # As it is told.", (1, "'told'")),
        ('print(f"{1} in place of {2}")', (1, "'in place of'")),
        ('print("two " "words; let alone three")', (1, "'let alone'")),
        ("for each in []: pass", (1, "the name 'each'")),
        ("[own for own in []]", (1, "the name 'own'")),
        ("def f(found): ...", (1, "the name 'found'")),
    ],
)
def test_a_fault_is_noticed(source: str, fault: tuple[int, str]):
    assert list(code_faults(source)) == [fault]


@pytest.mark.parametrize(
    "source",
    [
        '"""Each mean has its own interval; no result was found."""',
        "class Finding:\n    found: bool\nfinding.found = 1",
        'row["told"] = 1',
        "x = 'that'",
    ],
)
def test_plain_words_are_no_fault(source: str):
    assert list(code_faults(source)) == []
