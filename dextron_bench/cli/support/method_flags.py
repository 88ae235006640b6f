"""Adds the settings of a method to the flags of a command: `run --method rlil` also has the flags of RLIL."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tyro

from dextron_bench.cli.support import streams, usage
from dextron_bench.cli.support.usage import FIELD

COMMANDS = ("run", "eval", "sweep", "sweep cross-validate")  # They take the settings of --method.
OF_AGENTS = ("check", "submit")  # They take the settings of an agent, their first word.
ALL, METHOD = "--all", "--method"


@dataclass(frozen=True)
class Length:
    """The setting that all methods with training share."""

    preset: Literal["paper", "quick", "tenth", "smoke"] = "paper"
    """How long methods train."""


def with_method_settings(names: Sequence[str], words: Sequence[str], command: Any) -> Any:
    """The command with a field for the settings of the method that the words name; unchanged if it has no settings.

    Raises UnknownMethod, BadSettings, BadSpec.
    """
    spec, name = _method_spec(words), " ".join(names)
    if name in OF_AGENTS:
        spec = _agent_spec(words, command)
    elif name not in COMMANDS:
        return command
    if ALL in words and name == "run":
        return _with_settings(command, Length)
    if not spec:
        return command
    from dextron_bench.methods import registry
    from dextron_bench.methods.settings import settings_class

    flags = set(_flags(command)) - {FIELD}
    method = settings_class(registry.find_method(spec), taken=flags)
    if method is None:
        return command
    if taken := [field.name for field in dataclasses.fields(method) if field.name in flags]:
        raise registry.BadSettings(
            f"method {spec!r} has a setting {taken[0]!r}, but {name!r} already has a flag of this name"
        )
    return _with_settings(command, method)


@contextmanager
def as_bad_settings(words: Sequence[str]) -> Iterator[None]:
    """Turns any error of a method's class into BadSettings while its settings are parsed."""
    try:
        yield
    except BrokenPipeError:  # The reader of the help has stopped, as `| head` does.
        raise
    except Exception as error:
        from dextron_bench.methods import registry

        raise registry.BadSettings(
            f"method {(_method_spec(words) or words[0])!r}: {' '.join(str(error).split())}"
        ) from error


def settings_dict(settings: Any) -> dict[str, Any]:
    """The settings in a command's field, by name."""
    return {} if settings is None else {f.name: getattr(settings, f.name) for f in dataclasses.fields(settings)}


def changed_settings(settings: Any) -> dict[str, Any]:
    """The settings in a command's field that are not the defaults, by name."""
    from dextron_bench.methods.settings import default

    fields = () if settings is None else dataclasses.fields(settings)
    values = {one.name: (getattr(settings, one.name), default(one)) for one in fields}
    return {name: value for name, (value, usual) in values.items() if value != usual}


def _agent_spec(words: Sequence[str], command: Any) -> str | None:
    """The agent, the first word, if its settings can be flags and are needed; otherwise its file is not imported."""
    from dextron_bench.methods import specs

    if not words or words[0].startswith("-") or specs.parse(words[0]).kind in ("policy", "command"):
        return None
    is_help = any(word in streams.HELP for word in words)
    return words[0] if is_help or usage.unknown_flags(words, usage.flags(command)) else None


def _flags(command: Any) -> Iterator[str]:
    """Names of the flags of a command; a field whose default is made by a dataclass is a group of flags."""
    for field in dataclasses.fields(command):
        group = field.default_factory
        if dataclasses.is_dataclass(group):
            yield from _flags(group)
        else:
            yield field.name


def _method_spec(arguments: Sequence[str]) -> str | None:
    """The value of the last --method."""
    spec = None
    for argument, following in zip(arguments, [*arguments[1:], ""], strict=False):
        if argument == METHOD:
            spec = following
        elif argument.startswith(f"{METHOD}="):
            spec = argument.partition("=")[2]
    return spec


def _with_settings(command: type, settings: type) -> type:
    """A subclass of the command whose field for settings has the flags of `settings`."""
    flat = Annotated[settings, tyro.conf.arg(name="")]
    field = (FIELD, flat, dataclasses.field(default_factory=settings))
    subclass = dataclasses.make_dataclass(command.__name__, [field], bases=(command,), frozen=True, kw_only=True)
    subclass.__doc__ = command.__doc__
    return subclass
