"""The settings of a method: the fields of a dataclass, or the parameters of another class that have defaults."""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Collection, Mapping
from dataclasses import MISSING, Field, asdict, field, fields, is_dataclass, make_dataclass
from typing import Any
from weakref import WeakKeyDictionary

from dextron_bench.errors import BadInput
from dextron_bench.storage import hashing

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")  # A run's folder has the name of its method.
PLAIN = (bool, int, float, str, tuple, type(None))  # Types of defaults; a parameter with another is no setting.
LONGEST_VALUE = 24  # Characters of a setting's value in a label.


class BadSettings(BadInput):
    """Settings that a method does not have, or refuses."""


def settings_class(method: type, taken: Collection[str] = ()) -> type | None:
    """A dataclass whose fields are the settings: the method itself, or one made of its parameters; None without any.

    No settings are parameters without a plain default, parameters without a type whose default is None, and those whose
    names are `taken`.
    """
    if is_dataclass(method):
        return method if fields(method) else None
    parameters = {name: part for name, part in _parameters(method).items() if name not in taken}
    if not parameters:
        return None
    made = [
        (name, kind, field(default_factory=lambda value=value: value)) for name, (kind, value) in parameters.items()
    ]
    return make_dataclass("Settings", made, frozen=True)


_GIVEN: WeakKeyDictionary[Any, dict[str, Any]] = WeakKeyDictionary()  # Of objects whose class is no dataclass.


def remember(method: Any, given: Mapping[str, Any]) -> None:
    """Notes the settings with which an object was made, for `settings_of`, if its class is no dataclass.

    Raises BadSettings for an object that cannot be noted.
    """
    if is_dataclass(method):
        return
    defaults = {name: value for name, (_, value) in _parameters(type(method)).items()}
    differing = {name: value for name, value in given.items() if name not in defaults or value != defaults[name]}
    try:
        _GIVEN[method] = differing
    except TypeError as error:  # An object with __slots__, or without a hash.
        if differing:
            raise BadSettings(f"method {method.name!r} can have settings only as a dataclass ({error})") from error


def settings_of(method: Any) -> dict[str, Any]:
    """A method's settings as plain values, by name; without the defaults if its class is no dataclass."""
    if is_dataclass(method) and not isinstance(method, type):
        return asdict(method)
    try:
        return dict(_GIVEN.get(method, {}))
    except TypeError:
        return {}


def defaults_of(method: Any) -> dict[str, Any]:
    """The defaults of a method whose class is no dataclass, which `settings_of` leaves out; a seed is no setting."""
    if is_dataclass(method):
        return {}
    return {name: value for name, (_, value) in _parameters(type(method)).items() if name != "seed"}


def in_label(method: Any) -> str:
    """The settings that are not the defaults, as a label has them, such as "-near0.06"."""
    if not is_dataclass(method):
        return "".join(f"-{name}{_short(value)}" for name, value in settings_of(method).items())
    labelled = [one for one in fields(method) if one.metadata.get("in_label", True)]
    values = {one: getattr(method, one.name) for one in labelled}
    return "".join(f"-{one.name}{_short(value)}" for one, value in values.items() if value != default(one))


def default(one: Field[Any]) -> Any:
    """The default of a field."""
    return one.default if one.default_factory is MISSING else one.default_factory()


def _parameters(method: type) -> dict[str, tuple[Any, Any]]:
    """Type and default of each parameter of a class that has a plain default, by name."""
    try:
        parameters = inspect.signature(method.__init__).parameters.values()
        hints = typing.get_type_hints(method.__init__)
    except (ValueError, TypeError, NameError, AttributeError):  # Of a class in C, or a type that does not exist.
        return {}
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    named = [one for one in parameters if one.kind in kinds and isinstance(one.default, PLAIN)]
    typed = {one.name: (hints.get(one.name, type(one.default)), one.default) for one in named}
    return {name: (kind, value) for name, (kind, value) in typed.items() if kind is not type(None)}


def _short(value: object) -> str:
    """A value as a part of a label."""
    text = f"{value:g}" if isinstance(value, float) else str(value)
    if isinstance(value, float) and float(text) != value:  # Six digits say another number.
        text = repr(value)
    if len(text) <= LONGEST_VALUE and NAME.fullmatch(f"a{text}"):
        return text
    return hashing.digest(repr(value).encode())[:8]
