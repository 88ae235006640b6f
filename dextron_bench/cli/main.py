"""The command line: which verbs there are, and how what goes wrong becomes a line and an exit code.

A verb is a frozen dataclass: its fields are the flags, its docstring the help, its call the work. Modules of
verbs import nothing heavy, so that help is quick.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr
from typing import Annotated, Any, Protocol, Union

import tyro

from dextron_bench.cli import (
    check,
    compare,
    data,
    data_export,
    data_synthetic,
    doctor,
    figures,
    leaderboard,
    leaderboard_verify,
    mc,
    method_flags,
    new_agent,
    recordings,
    recordings_choose,
    run,
    splits,
    submit,
    success,
    success_eval,
    view,
)
from dextron_bench.cli import eval as evaluation
from dextron_bench.cli import list as listing


class Command(Protocol):
    """Does its work when called, and returns the exit code."""

    def __call__(self) -> int: ...


Group = tuple[str, dict[str, type[Command]]]  # What a group of verbs is about, and its verbs.

COMMANDS: dict[str, type[Command] | Group] = {
    "run": run.Run,
    "eval": evaluation.Eval,
    "leaderboard": (
        "The leaderboard: show that of a folder of runs; build, serve and verify the published one; add to it.",
        {
            **{"show": leaderboard.Show, "build": leaderboard.Build, "serve": leaderboard.Serve},
            **{"verify": leaderboard_verify.Verify, "add": leaderboard_verify.Add},
        },
    ),
    "new-agent": new_agent.NewAgent,
    "check": check.Check,
    "submit": submit.Submit,
    "compare": compare.Compare,
    "view": view.View,
    "recordings": (
        "Recordings: list them, export one as a film or a table, choose a few of the runs'.",
        {"list": recordings.List, "export": recordings.Export, "choose": recordings_choose.Choose},
    ),
    "list": listing.List,
    "data": (
        "Reaches: import or fetch the recorded ones, see what a source holds, fit and judge the synthetic ones; "
        "export episodes for offline learning.",
        {
            **{"import": data.Import, "fetch": data.Fetch, "info": data.Info},
            **{"fit": data_synthetic.Fit, "likeness": data_synthetic.Likeness, "export": data_export.Export},
        },
    ),
    "mc": mc.MonteCarlo,
    "splits": splits.Splits,
    "success": (
        "The success model: play its data set, train it, judge it, explain episodes by it.",
        {"data": success.Data, "train": success.Train, "eval": success_eval.Eval, "explain": success_eval.Explain},
    ),
    "figures": figures.Figures,
    "doctor": doctor.Doctor,
}

DONE, DIFFERS, USAGE, EPISODES_FAILED, BUG, INTERRUPTED = 0, 1, 2, 3, 70, 130  # Exit codes.
BLAS = "OPENBLAS_NUM_THREADS"  # NumPy's products are small here: threads would mostly wait for each other.
OWN = ("dextron_bench", "baselines")  # Exceptions defined here are messages to the user.
DESCRIPTION = """Grasping with a prosthetic hand that a person moves: a benchmark.

Exit codes: 0 done, 1 a verification or comparison failed, 2 wrong usage or input, 3 some episodes failed,
130 interrupted. With --debug, or DEXTRON_DEBUG set, errors show where they came from."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one verb and returns its exit code; `arguments` default to the process's own."""
    os.environ.setdefault(BLAS, "1")  # Before NumPy is imported.
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words or bool(os.environ.get("DEXTRON_DEBUG"))
    words = [word for word in words if word != "--debug"]
    if words == ["--version"]:
        return _print_version()
    try:
        code = _parse(words)()
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # Whoever read the results has seen enough, as `| head` does.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except (KeyboardInterrupt, Exception) as error:
        if debug:
            raise
        code, message = explain(error)
        print(f"dextron-bench: {message}", file=sys.stderr)
        return code


def explain(error: BaseException) -> tuple[int, str]:
    """Exit code and one line for what ended a verb."""
    text = " ".join(str(error.args[0] if isinstance(error, KeyError) and error.args else error).split())
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "interrupted"
    if type(error).__module__.split(".")[0] in OWN:
        return USAGE, text
    if isinstance(error, OSError):
        reason = error.strerror or text
        return USAGE, f"{reason}: {error.filename}" if error.filename else reason
    if isinstance(error, ModuleNotFoundError):
        return USAGE, f"{text}; `dextron-bench doctor` shows what is missing"
    return BUG, f"unexpected {type(error).__name__}: {text}; --debug shows where, and a report would be welcome"


def _parse(words: Sequence[str]) -> Command:
    """The verb that words ask for; wrong ones end the process with a line and code 2."""
    if words and words[0] in method_flags.COMMANDS:
        verbs: dict[str, Any] = {**COMMANDS, words[0]: method_flags.widen(words, COMMANDS[words[0]])}
        with method_flags.as_bad_settings(words):
            return _told(verbs, words)
    return _told(COMMANDS, words)


def _told(verbs: Mapping[str, type[Command] | Group], words: Sequence[str]) -> Command:
    """The verb; what is wrong with words is told in a line, where tyro has a frame of many."""
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            return tyro.cli(_union(verbs), prog="dextron-bench", description=DESCRIPTION, args=words)
    except SystemExit as ended:
        if ended.code:
            verb = " ".join(["dextron-bench", *_named(verbs, words)])
            print(f"dextron-bench: {method_flags.in_a_line(said.getvalue())}; see `{verb} --help`", file=sys.stderr)
        raise


def _named(verbs: Mapping[str, type[Command] | Group], words: Sequence[str]) -> list[str]:
    """The verb that words begin with: its name, behind that of its group if it is in one."""
    if not words or words[0] not in verbs:
        return []
    verb = verbs[words[0]]
    return [words[0], *(_named(verb[1], words[1:]) if isinstance(verb, tuple) else ())]


def _union(verbs: Mapping[str, type[Command] | Group]) -> Any:
    """The table of verbs as the type that tyro makes subcommands of."""
    named: list[Any] = []
    for name, verb in verbs.items():
        if isinstance(verb, tuple):
            about, inner = verb
            named.append(Annotated[_union(inner), tyro.conf.subcommand(name, description=about)])
        else:
            named.append(Annotated[verb, tyro.conf.subcommand(name)])
    return Union[tuple(named)]  # noqa: UP007 (built at run time)


def _print_version() -> int:
    from importlib.metadata import PackageNotFoundError, version

    try:
        print(f"dextron-bench {version('dextron-bench')}")
    except PackageNotFoundError:
        print("dextron-bench, run from its source without being installed")
    return DONE


if __name__ == "__main__":
    sys.exit(main())
