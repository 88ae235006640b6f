"""Adds the settings of a method to the flags of a command: `run --method rlil` also has the flags of RLIL."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tyro

COMMANDS = ("run", "eval", "sweep", "cross-validate")  # They take the settings of a method.
FIELD = "method_settings"  # Of these commands, for the settings. Its name is no flag, and methods have others.
ALL, METHOD = "--all", "--method"


@dataclass(frozen=True)
class Length:
    """The setting that all methods with training share."""

    preset: Literal["paper", "quick", "tenth", "smoke"] = "paper"
    """How long methods train."""


def with_method_settings(arguments: Sequence[str], command: Any) -> Any:
    """The command with a field for the settings of the method that the arguments name; unchanged if it has no settings.

    Raises UnknownMethod, BadSettings.
    """
    spec = _method_spec(arguments)
    if ALL in arguments and arguments[0] == "run":
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
            f"method {spec!r} has a setting {taken[0]!r}, but {arguments[0]!r} already has a flag of this name"
        )
    return _with_settings(command, method)


@contextmanager
def as_bad_settings(arguments: Sequence[str]) -> Iterator[None]:
    """Turns any error of a method's class into BadSettings while its settings are parsed."""
    try:
        yield
    except BrokenPipeError:  # The reader of the help has stopped, as `| head` does.
        raise
    except Exception as error:
        from dextron_bench.methods import registry

        raise registry.BadSettings(f"method {_method_spec(arguments)!r}: {' '.join(str(error).split())}") from error


def settings_dict(settings: Any) -> dict[str, Any]:
    """The settings in a command's field, by name."""
    return {} if settings is None else {f.name: getattr(settings, f.name) for f in dataclasses.fields(settings)}


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
    for argument, following in zip(arguments, [*arguments[1:], ""], strict=True):
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
