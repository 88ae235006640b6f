"""The entry point of the command line: parses the arguments and turns each error into one line and an exit code.

The modules of commands import nothing heavy at their top, so that `--help` is quick.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from typing import NoReturn

import tyro

from dextron_bench.cli import commands, help_screen
from dextron_bench.cli.commands import Command
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
PROGRAM = "dextron-bench"


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
    names, command, words = commands.find(arguments)
    if command is None or isinstance(command, commands.Group):
        if words and words[0] in streams.HELP:
            help_screen.show(names, command)
            raise SystemExit(DONE)
        known = command.members if command else commands.COMMANDS
        _end(names, _moved(names, words) or usage.unknown_word(words, known))
    whole = method_flags.with_method_settings(names, words, command)
    with method_flags.as_bad_settings(words) if whole is not command else nullcontext():
        return _parsed_flags(names, whole, words)


def _parsed_flags(names: Sequence[str], command: type[Command], words: Sequence[str]) -> Command:
    """The command with its flags; prints one line about wrong ones instead of the box that tyro draws."""
    if any(word in streams.HELP for word in words):
        description = help_screen.description(names, command)
        return tyro.cli(command, prog=" ".join([PROGRAM, *names]), description=description, args=words)
    try:
        return usage.parse(command, words)
    except SystemExit:
        unknown = usage.unknown_flags(words, usage.flags(command))
        moved = next((line for flag in unknown if (line := _moved_flag(names, flag))), "")
        _end(names, moved or usage.fault(command, words))


def _end(names: Sequence[str], fault: str) -> NoReturn:
    """Ends the process with one line about wrong arguments, and where the help is."""
    print_warning(f"{fault}; see `{' '.join([PROGRAM, *names])} --help`")
    raise SystemExit(USAGE)


def _moved(names: Sequence[str], words: Sequence[str]) -> str:
    """The line about the old name of a command; empty for other words."""
    old = " ".join([*names, *words[:1]])
    return f"`{old}` is now {commands.MOVED[old]}" if old in commands.MOVED else ""


def _moved_flag(names: Sequence[str], flag: str) -> str:
    """The line about the old name of a flag; empty for other flags."""
    new = commands.MOVED_FLAGS.get((" ".join(names), flag))
    return f"{flag} is now {new}" if new else ""


def _print_version() -> int:
    from importlib.metadata import PackageNotFoundError, version

    try:
        print(f"dextron-bench {version('dextron-bench')}")
    except PackageNotFoundError:
        print("dextron-bench, not installed: it runs from its source")
    return DONE


if __name__ == "__main__":
    sys.exit(main())
