"""Wrong values for every flag of every command: each is one line and code 2 or 1, never an unexpected error.

The commands and their flags come from the table of commands, so that new ones are tried, too.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import os
import pkgutil
import random
import signal
import subprocess
import sys
import typing
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib import request

import pytest

import dextron_bench
from dextron_bench.catalogue import mlflow_export
from dextron_bench.cli import main
from dextron_bench.cli.commands import COMMANDS, Group
from dextron_bench.cli.support import method_flags, usage
from dextron_bench.cli.support.exit_codes import BUG
from dextron_bench.methods.isolation import sandbox
from dextron_bench.recording import viewer

SECONDS = 0.5  # After which a command has accepted its words, and is ended.
VALUES = (
    *("", " ", "x", "-", "--", "-1", "0", "1", "3.5", "1e999", "-1e999", "nan", "inf", "-inf", "1e-320", "9" * 30),
    *("-" + "9" * 30, "9" * 5000, "True", "None", "[]", "{}", "null", '{"near": NaN}', '{"\\u0000": 1}', "0x10", "1_0"),
    *("\x01", "a\x00b", "a\nb", "\x1b[31m", "\u202e", "\ud800", "\N{PILE OF POO}", "x" * 300, "x/" * 3000, "x" * 70000),
    *(".", "..", "/", "//", "../..", "~", "~nobody", "a/b/c", "/dev/null", "/dev/full", "/proc/self/mem", "con", "nul"),
    *("NUL.txt", "a:b", ":", "a:", ":b", "a.py:", "a.py:B", "file.py:Mine", "exec:", "exec:'", "exec:x", "os:path"),
    *(
        "p.pt",
        "p.onnx",
        "*",
        "?",
        "[",
        "**",
        "%s",
        "{0}",
        "$HOME",
        "`x`",
        "a b",
        "a,b",
        "a=b",
        "=",
        "1/2",
        "2/1",
        "0/0",
    ),
    *("1/99999999999999999999", "near=0:1:log", "near=1..0", "near=nan,1", "a==", "return <", "__import__('os')"),
    *("file", "file/below", "folder", "folder/new", "dangling", "loop", "loop/x", "empty.json", "list.json", "cut.rrd"),
    *("file.py", "bytes", "bytes.zip", "cut.parquet", "test", "train", "val", "real", "synthetic", "minjerk", "mp4"),
    *("x.gif", "x.mp4", "x.csv", "x.parquet", "x.png", "x.svg", "folder.png", "http://x", "ray://", "ray://x", "cuda"),
)
ALONE = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
ALSO = {"run": ("--method", "nothing"), "eval": ("--method", "nothing"), "sweep": ("--method", "reflex")}


class Accepted(BaseException):
    """Ends a command that has accepted its words."""


@pytest.fixture(scope="module", autouse=True)
def loaded() -> None:
    """Loads all modules: an import that is broken off leaves half of a library behind."""
    for module in pkgutil.walk_packages(dextron_bench.__path__, "dextron_bench."):
        if not module.name.endswith(("__main__", "_process", ".worker", "template", "process")):
            try:
                importlib.import_module(module.name)
            except ImportError:  # Of an extra that is not installed.
                continue
    with contextlib.suppress(ImportError):
        importlib.import_module("ray")  # Which no module imports before a command needs it.
    sandbox.is_available()


@pytest.fixture
def folder(tiny_world: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working folder with files of wrong kinds, where no command starts a viewer or uses the network."""

    def refuse(*_: Any, **__: Any) -> None:
        raise viewer.ViewerError("no viewer in this test")

    monkeypatch.setattr(viewer, "viewer_process", refuse)
    monkeypatch.setattr(request, "urlopen", refuse)
    monkeypatch.setattr(mlflow_export, "_write_database", _accept)  # An import of MLflow that is broken off stays so.
    monkeypatch.setenv("DEXTRON_CACHE", str(tiny_world / "cache"))
    for name, content in {
        **{"file": b"text", "empty.json": b"{}", "list.json": b"[1]", "cut.rrd": b"RRF2\0\0", "bytes": b"\xff\xfe\0"},
        **{"bytes.zip": b"PK\5\6" + bytes(18), "cut.parquet": b"PAR1", "file.py": b"class Mine:\n    name = 1\n"},
    }.items():
        (tiny_world / name).write_bytes(content)
    (tiny_world / "folder").mkdir()
    (tiny_world / "folder.png").mkdir()
    (tiny_world / "dangling").symlink_to("nowhere")
    (tiny_world / "loop").symlink_to("loop")
    signal.signal(signal.SIGALRM, _accept)
    yield tiny_world
    signal.setitimer(signal.ITIMER_REAL, 0)


def _accept(*_: object) -> None:
    raise Accepted


def commands() -> Iterator[tuple[tuple[str, ...], Any]]:
    """The words of each command, and its class."""
    for name, command in COMMANDS.items():
        if not isinstance(command, Group):
            yield (name,), command
            continue
        if command.command:
            yield (name,), command.command
        yield from (((name, member), cls) for member, cls in command.members.items())


def is_positional(hint: Any) -> bool:
    """True for the type of a field that is no flag."""
    return any("ositional" in str(part) for part in getattr(hint, "__metadata__", ()))


def wrong_words(command: tuple[str, ...], cls: Any) -> Iterator[tuple[str, ...]]:
    """The words of a command with one wrong value each, and plausible ones for what it needs."""
    start = (*command, *ALSO.get(command[0], ()))
    cls = method_flags.with_method_settings(command, start[len(command) :], cls)
    hints = typing.get_type_hints(cls, include_extras=True)
    needed: dict[str, tuple[str, ...]] = {}
    given: list[tuple[str, str]] = []
    for field in dataclasses.fields(cls):
        names = (
            [""]
            if is_positional(hints[field.name])
            else [option.name for option in usage._options_of(field, hints[field.name])]
        )
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            needed[field.name] = (names[0], "folder") if names[0] else ("folder",)
        given += [(field.name, name) for name in names]
    for field, flag in given:
        others = [word for name, words in needed.items() if name != field for word in words]
        for value in VALUES:
            yield (*start, *others, f"{flag}={value}" if flag else value)
    yield start


def ending(words: Sequence[str]) -> int | str | None:
    """The exit code of a command that is ended after some time."""
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        return main.main(list(words))
    except SystemExit as ended:
        return ended.code
    except Accepted:
        return None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def try_all(every: Sequence[tuple[str, ...]], capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The words that end with code 70, with the line that they print."""
    failures = []
    for words in every:
        capsys.readouterr()
        if ending(words) == BUG and ends_so_alone(words):
            failures.append(f"{' '.join(words)[:200]!a}: {capsys.readouterr().err[:300]}")
    return failures


def ends_so_alone(words: Sequence[str]) -> bool:
    """True if a process of its own ends with code 70: a command that was broken off may have spoilt a library here."""
    try:
        return subprocess.run([sys.executable, "-m", "dextron_bench", *words], timeout=60, env=ALONE).returncode == BUG
    except ValueError:  # Words that no process can be given.
        return True
    except subprocess.TimeoutExpired:
        return False


ALL = list(commands())
EVERY = pytest.mark.parametrize(("command", "cls"), ALL, ids=["-".join(words) for words, _ in ALL])
QUICK = {("view",), ("compare",), ("runs", "export"), ("recordings", "list"), ("leaderboard", "serve")}
SOME = [
    pytest.param(words, cls, id="-".join(words), marks=() if words in QUICK else pytest.mark.slow) for words, cls in ALL
]


@pytest.mark.parametrize(("command", "cls"), SOME)
def test_a_wrong_value_is_never_an_unexpected_error(
    command: tuple[str, ...], cls: Any, folder: Path, capsys: pytest.CaptureFixture[str]
):
    every = list(wrong_words(command, cls))
    assert try_all(random.Random(0).sample(every, min(8, len(every))), capsys) == []


@pytest.mark.slow
@EVERY
def test_no_wrong_value_of_many_is_an_unexpected_error(
    command: tuple[str, ...], cls: Any, folder: Path, capsys: pytest.CaptureFixture[str], thorough: bool
):
    every = list(wrong_words(command, cls))
    assert try_all(every if thorough else random.Random(1).sample(every, min(15, len(every))), capsys) == []
