"""What a user writes to name an agent, parsed in one place.

| kind | text | parts |
| --- | --- | --- |
| `method` | `reflex` | name of an installed method |
| `module` | `package.module:MyAgent` | location is the module, name is the class |
| `file` | `my_agent/agent.py:MyAgent` | location is the path, name is the class |
| `policy` | `policy.pt`, `policy.onnx` | location is the path |
| `command` | `exec:./agent --fast` | location is the command line |
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dextron_bench.errors import BadInput

Kind = Literal["method", "module", "file", "policy", "command"]

COMMAND = "exec:"  # A command begins with this.
PYTHON = ".py"
POLICIES = (".pt", ".onnx")  # TorchScript and ONNX.


class BadSpec(BadInput):
    """A text that names no agent; the message says what to write instead."""


@dataclass(frozen=True, slots=True)
class AgentSpec:
    """What a user's text names; `str` returns that text. The module's table says which parts each kind has."""

    kind: Kind
    name: str = ""
    location: str = ""

    def __str__(self) -> str:
        if self.kind == "command":
            return COMMAND + self.location
        return ":".join(part for part in (self.location, self.name) if part)

    @property
    def file(self) -> Path | None:
        """The file of code or of a policy that the spec names; None if it names no file."""
        return Path(self.location) if self.kind in ("file", "policy") else None

    def command(self) -> list[str]:
        """The words of a command line, split as a shell splits them."""
        return shlex.split(self.location)


def parse(text: str) -> AgentSpec:
    """The agent that a text names; no file is read and nothing is imported.

    Raises BadSpec if the text is empty, a command cannot be split into words, a file has no class, or a class has no
    module.
    """
    if text.startswith(COMMAND):
        return _command(text)
    if Path(text).suffix in POLICIES:
        return AgentSpec("policy", location=text)
    if text.endswith(PYTHON):
        raise BadSpec(f"{text} is a file: name its class too, as in {text}:MyAgent")
    location, colon, name = text.rpartition(":")
    if not colon and name:
        return AgentSpec("method", name=name)
    if not location or not name:
        raise BadSpec(f"{text!r} names no agent: write a method's name, module:Class or file.py:Class")
    return AgentSpec("file" if location.endswith(PYTHON) else "module", name, location)


def _command(text: str) -> AgentSpec:
    spec = AgentSpec("command", location=text.removeprefix(COMMAND))
    try:
        words = spec.command()
    except ValueError as error:
        raise BadSpec(f"{text} is not a command ({error})") from error
    if not words:
        raise BadSpec(f"{text!r} names no program: write the command after {COMMAND!r}")
    return spec
