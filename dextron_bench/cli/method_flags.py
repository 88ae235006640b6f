"""A method's settings as flags: `run --method rlil` has those of RLIL beside its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import groupby
from typing import Annotated, Any, Literal

import tyro

COMMANDS = ("run", "eval")  # Those that take a method's settings.
RULE = "-"  # Divides what tyro says.
ALL, METHOD = "--all", "--method"


@dataclass(frozen=True)
class Length:
    """What all methods that train have in common."""

    preset: Literal["paper", "quick", "smoke"] = "paper"
    """How long methods train."""


def widen(words: Sequence[str], verb: Any) -> Any:
    """The verb with a field `settings` of the method that its words name; the verb itself where there are none.

    Raises UnknownMethod, BadSettings.
    """
    spec = _chosen(words)
    if ALL in words and words[0] == "run":
        return _with(verb, Length, Length)
    if spec is None or not spec:
        return verb
    from dextron_bench.methods import registry

    found = registry.find_method(spec)
    if not dataclasses.is_dataclass(found) or not dataclasses.fields(found):
        return verb
    own = {field.name for field in dataclasses.fields(verb)}
    if taken := [field.name for field in dataclasses.fields(found) if field.name in own]:
        raise registry.BadSettings(
            f"method {spec!r} has a setting {taken[0]!r}, which is a flag of {words[0]!r} itself"
        )
    return _with(verb, found, found)


@contextmanager
def as_bad_settings(words: Sequence[str]) -> Iterator[None]:
    """Makes what a method's class raises while settings are read BadSettings."""
    try:
        yield
    except Exception as error:
        from dextron_bench.methods import registry

        raise registry.BadSettings(f"method {_chosen(words)!r}: {' '.join(str(error).split())}") from error


def in_a_line(framed: str) -> str:
    """What a frame of tyro's says, drawn in lines or in ASCII; its title and help on the flag are left out."""
    rows = [row.strip(" │─╭╮╰╯") or RULE for row in framed.replace("╮", f"\n{RULE}").splitlines() if row.strip()]
    parts = [" ".join(part) for rule, part in groupby(rows, lambda row: not row.strip(RULE)) if not rule]
    told = [part.rstrip(".") for part in parts[1:] if not part.startswith(("Argument helptext", "For full helptext"))]
    return "; ".join(told) or " ".join(framed.split())


def chosen(settings: Any) -> dict[str, Any]:
    """The values of a verb's field `settings`."""
    return {} if settings is None else {f.name: getattr(settings, f.name) for f in dataclasses.fields(settings)}


def _chosen(words: Sequence[str]) -> str | None:
    """The value of the last --method."""
    found = None
    for word, after in zip(words, [*words[1:], ""], strict=True):
        if word == METHOD:
            found = after
        elif word.startswith(f"{METHOD}="):
            found = word.partition("=")[2]
    return found


def _with(verb: type, settings: type, default: Callable[[], Any]) -> type:
    flat = Annotated[settings, tyro.conf.arg(name="")]
    field = ("settings", flat, dataclasses.field(default_factory=default))
    made = dataclasses.make_dataclass(verb.__name__, [field], bases=(verb,), frozen=True, kw_only=True)
    made.__doc__ = verb.__doc__
    return made
