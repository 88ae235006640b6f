"""The entry point of the command line: parses the arguments and turns each error into one line and an exit code.

The modules of commands import nothing heavy at their top, so that `--help` is quick.
"""

from __future__ import annotations

import inspect
import io
import os
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr
from typing import Annotated, Any, Union

import tyro

from dextron_bench.cli.commands import COMMANDS, Command, Group
from dextron_bench.cli.support import method_flags, places, streams, usage
from dextron_bench.cli.support.exit_codes import BUG, DONE, INTERRUPTED, USAGE
from dextron_bench.cli.support.output import print_warning
from dextron_bench.processes import programs
from dextron_bench.processes.limited_process import memory_advice

# The products of NumPy and of torch are small here: more threads would mostly wait for each other, above all on a busy
# machine.
THREADS = {"OPENBLAS_NUM_THREADS": "blas", "OMP_NUM_THREADS": "openmp"}
PACKAGES = ("dextron_bench", "baselines")  # Their exceptions are messages to the user.
LOOP = "Symlink loop"  # How `Path.resolve` begins to say so, before Python 3.13.
DESCRIPTION = """Grasping with a prosthetic hand that a person moves: a benchmark.

Exit codes: 0 done, 1 a verification or comparison failed, 2 wrong usage or input, 3 the agent raised errors in some
episodes, 70 an unexpected error, 130 interrupted. With --debug, or if DEXTRON_DEBUG is set, an error shows its
traceback."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit code; `arguments` default to `sys.argv`."""
    programs.keep_to_installed_code()
    _limit_threads()
    streams.prepare()
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words or bool(os.environ.get("DEXTRON_DEBUG"))
    words = [word for word in words if word != "--debug"]
    command = None
    try:
        with streams.only_json(words):
            try:
                command = _parsed(words)
                return command()
            finally:
                sys.stdout.flush()
    except BrokenPipeError:  # The reader of the results has stopped, as `| head` does.
        return DONE
    except (KeyboardInterrupt, Exception) as error:
        if debug:
            raise
        code, message = explain(error)
        print_warning(message + places.advice(error, command))
        return code
    finally:
        streams.give_up_output()


def _parsed(words: Sequence[str]) -> Command:
    """The command that the words select, with checked numbers."""
    if broken := [word for word in words if not _is_utf8(word) or "\0" in word]:
        raise usage.BadName(name_fault(broken[0]))
    if list(words) == ["--version"]:
        return _print_version
    command = _parse(words)
    usage.check_numbers(command)
    return command


def _limit_threads() -> None:
    """Gives each product of NumPy and of torch one thread, unless the user sets a variable of THREADS.

    If the user wants several, they sleep while they wait for each other, and do not spin, which stalls a busy machine.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    if not (limits := {library: 1 for name, library in THREADS.items() if name not in os.environ}):
        return
    import threadpoolctl

    for name in THREADS:
        os.environ.setdefault(name, "1")  # For libraries that are loaded later, such as SciPy's and torch's.
    threadpoolctl.threadpool_limits(limits)  # For NumPy's, which `import dextron_bench` has loaded.


def _is_utf8(text: str) -> bool:
    """False for an argument with bytes that Python could not decode, and kept as surrogates."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def name_fault(name: str) -> str:
    """Why the name of a file, or another argument, cannot be used: it is no UTF-8, or the locale is not."""
    if "\0" in name:
        return f"{name!a} has a zero byte, which no name of a file or of anything else has"
    try:
        name.encode(errors="surrogateescape").decode()
    except UnicodeError:
        return f"{name!a} is not valid UTF-8; rename the file or folder"
    return f"{name!a} has letters that this locale lacks; set LC_ALL=C.UTF-8, or PYTHONUTF8=1"


def _word_at(text: str, place: int) -> str:
    """The word of a text at a place: the name of a file, without the text around it."""
    return next(match[0] for match in re.finditer(r'[^\s"]+', text) if match.end() > place)


def explain(error: BaseException) -> tuple[int, str]:
    """The exit code and the line on stderr for an error that ended a command."""
    text = " ".join(str(error.args[0] if isinstance(error, KeyError) and error.args else error).split())
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "interrupted"
    if type(error).__module__.split(".")[0] in PACKAGES:
        return USAGE, text
    if isinstance(error, UnicodeEncodeError):  # Of a name on the disk: streams write what they lack as escapes.
        return USAGE, name_fault(_word_at(error.object, error.start))
    if isinstance(error, RuntimeError) and text.startswith(LOOP):
        return USAGE, text
    if isinstance(error, OSError):
        reason = error.strerror or text
        return USAGE, f"{reason}: {error.filename}" if error.filename else reason
    if isinstance(error, ModuleNotFoundError):
        return USAGE, f"{text}; `dextron-bench doctor` shows what is missing"
    if isinstance(error, MemoryError) or (isinstance(error, ImportError) and "failed to map" in text):
        return USAGE, f"there is too little memory ({text or 'no details'}){memory_advice()}"
    return BUG, f"unexpected {type(error).__name__}: {text}; --debug shows the traceback; please report it"


def _parse(arguments: Sequence[str]) -> Command:
    """The command that the arguments select; wrong arguments end the process with one line and code 2."""
    if arguments and arguments[0] in method_flags.COMMANDS:
        command = method_flags.with_method_settings(arguments, COMMANDS[arguments[0]])
        with method_flags.as_bad_settings(arguments):
            return _parse_commands({**COMMANDS, arguments[0]: command}, arguments)
    return _parse_commands(COMMANDS, arguments)


def _parse_commands(commands: Mapping[str, type[Command] | Group], arguments: Sequence[str]) -> Command:
    """The command; prints one line about wrong arguments instead of the box that tyro draws."""
    message = io.StringIO()
    try:
        with redirect_stderr(message):
            return tyro.cli(_union(commands, arguments), prog="dextron-bench", description=DESCRIPTION, args=arguments)
    except SystemExit as ended:
        if ended.code:
            name, command = _command_name(commands, arguments), _command(commands, arguments)
            known = list(command) if isinstance(command, Mapping) else usage.flags(command)
            unknown = "" if isinstance(command, Mapping) else usage.unknown_flag(arguments, known)
            line = unknown or usage.with_nearest(usage.one_line(message.getvalue()), known)
            print(f"dextron-bench: {line}; see `{' '.join(['dextron-bench', *name])} --help`", file=sys.stderr)
        raise


def _command_name(commands: Mapping[str, type[Command] | Group], arguments: Sequence[str]) -> list[str]:
    """The name of the command that the arguments start with, after the name of its group if it has one."""
    if not arguments or arguments[0] not in commands:
        return []
    command = commands[arguments[0]]
    return [arguments[0], *(_command_name(command[1], arguments[1:]) if isinstance(command, tuple) else ())]


def _command(commands: Mapping[str, type[Command] | Group], arguments: Sequence[str]) -> Any:
    """The command that the arguments start with, or the table of commands that was searched in vain."""
    if not arguments or arguments[0] not in commands:
        return commands
    command = commands[arguments[0]]
    return _command(command[1], arguments[1:]) if isinstance(command, tuple) else command


def _union(commands: Mapping[str, type[Command] | Group], arguments: Sequence[str] = ()) -> Any:
    """The table of commands as the union type that tyro turns into subcommands.

    The help of the table has the first paragraph of each command, and a command's own help has all of it.
    """
    types: list[Any] = []
    for name, command in commands.items():
        is_chosen = list(arguments[:1]) == [name]
        if isinstance(command, tuple):
            description, members = command
            union = _union(members, arguments[1:] if is_chosen else ())
            types.append(Annotated[union, tyro.conf.subcommand(name, description=description)])
        else:
            summary = None if is_chosen else (inspect.getdoc(command) or "").split("\n\n", 1)[0]
            types.append(Annotated[command, tyro.conf.subcommand(name, description=summary)])
    return Union[tuple(types)]  # noqa: UP007 (built at run time)


def _print_version() -> int:
    from importlib.metadata import PackageNotFoundError, version

    try:
        print(f"dextron-bench {version('dextron-bench')}")
    except PackageNotFoundError:
        print("dextron-bench, not installed: it runs from its source")
    return DONE


if __name__ == "__main__":
    sys.exit(main())
