"""How to start the process of an agent that a user names."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

from dextron_bench.methods import loading, specs
from dextron_bench.methods.agents import AgentError
from dextron_bench.methods.isolation import guard, sandbox
from dextron_bench.methods.specs import AgentSpec
from dextron_bench.processes import programs


class NoSandbox(AgentError):
    """Code that is not trusted, on a machine without a sandbox."""

    def __init__(self, spec: AgentSpec) -> None:
        super().__init__(
            f"{str(spec)!r} may come from a stranger and runs in a sandbox only: install bubblewrap "
            "(docs/agents.md), or add --trust to run it with all your rights"
        )


@dataclass(frozen=True, slots=True)
class Launch:
    """How to start an agent's process: by its own command, or, if `command` is empty, by the Python worker.

    `spec` has absolute paths; `folder` has the package of a module. `readable` are the files and folders that the
    process may read beside Python's own. Code that is not `trusted` starts in the sandbox or not at all.
    """

    spec: AgentSpec
    command: tuple[str, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    weights: str = ""
    readable: tuple[str, ...] = ()
    trusted: bool = True
    folder: str = ""

    def command_line(self, scratch: str, memory: int, disk: int) -> list[str]:
        """The words of the whole command: sandbox, limits [bytes], and the agent that writes to `scratch`.

        Raises NoSandbox if the code is not trusted and there is no sandbox.
        """
        if not self.trusted and not sandbox.is_available():
            raise NoSandbox(self.spec)
        request = json.dumps({**asdict(self), "scratch": scratch})
        worker = programs.python("-m", "dextron_bench.methods.isolation.worker", request)
        return sandbox.wrap(self.command or worker, scratch, self.readable, memory, disk, self._public_files())

    def _public_files(self) -> list[Path]:
        """This package's files that the process may read; empty for all, since an installed method may import any."""
        return [] if self.spec.kind == "method" else guard.public_files()


def prepare_launch(
    text: str, settings: dict[str, Any] | None = None, weights: Path | None = None, trust: bool = False
) -> Launch:
    """How to start the agent that a text names (see `methods.specs`).

    `weights` is the file of a method that learns. Without `trust`, a policy's file (TorchScript, ONNX) starts in the
    sandbox only, since nobody reads such a file before it runs. Raises AgentError if the text names no agent or a file
    is missing.
    """
    try:
        spec = specs.parse(text)
    except specs.BadSpec as error:
        raise AgentError(str(error)) from error
    if spec.kind == "command":
        return _launch_command(spec)
    if spec.kind == "policy":
        file = _existing(spec.location)
        return Launch(replace(spec, location=file), readable=(file,), trusted=trust)
    code, folder = list[str](), ""
    if spec.kind == "file":
        spec = replace(spec, location=_existing(spec.location))
        code = [spec.location]
    elif spec.kind == "module" and (package := _find_package(spec.location.partition(".")[0])):
        code = list(package.submodule_search_locations or [package.origin or ""])
        folder = str(Path(code[0]).parent)
    file = str(weights.resolve()) if weights else ""
    readable = (*([file] if file else []), *code)
    return Launch(spec, settings=settings or {}, weights=file, readable=readable, folder=folder)


def _launch_command(spec: AgentSpec) -> Launch:
    """A program with its arguments; it may read the folders of all files that its command names."""
    command = tuple(str(Path(word).resolve()) if Path(word).is_file() else word for word in spec.command())
    folders = tuple(str(Path(word).resolve().parent) for word in spec.command() if Path(word).is_file())
    return Launch(spec, command, readable=folders)


def _existing(path: str) -> str:
    """The absolute path of a file; raises AgentError if it does not exist."""
    if not Path(path).is_file():
        raise AgentError(f"there is no file {path}")
    return str(Path(path).resolve())


def _find_package(name: str) -> ModuleSpec | None:
    try:
        return loading.find_package(name)
    except ValueError as error:
        raise AgentError(f"agents cannot come from the module {name} ({error})") from error
