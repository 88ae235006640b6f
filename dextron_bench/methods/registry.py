"""Methods by name: finds them, creates them with settings, and says how their runs are named."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

from dextron_bench.methods import loading, specs
from dextron_bench.methods import settings as method_settings
from dextron_bench.methods.agents import Agent, AgentError, as_agent_error
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.methods.loading import UnknownMethod, installed_methods
from dextron_bench.methods.settings import NAME, BadSettings, Settings, defaults_of, settings_of
from dextron_bench.storage.atomic import Json
from dextron_bench.storage.folders import visible
from dextron_bench.world import model

__all__ = [
    "NAME",
    "BadSettings",
    "UnknownMethod",
    "defaults_of",
    "installed_methods",
    "settings_of",
]  # Imported to be used as names of this module, too.

PAPER_METHODS: tuple[tuple[str, Settings], ...] = (  # The rows of figure 4a; `run --all` makes them.
    ("exp", {}),
    ("sim", {}),
    ("sor", {}),
    ("bc", {}),
    ("rl", {}),
    ("rlil", {"dur": 0.1}),
    ("rlil", {"dur": 0.3}),
)
FLOORS = "nothing", "random"  # Methods without a strategy: every other method should score higher.
CEILINGS = ("exp",)  # Methods that receive each setting's expert: the best possible score, not an entry.


class Method(Protocol):
    """A way to get an agent: a frozen dataclass whose fields are its settings, each with a default."""

    name: ClassVar[str]

    def agent(self, seed: int) -> Agent:
        """An agent that is ready to act; equal seeds return agents that act equally."""
        ...


@runtime_checkable
class SourceAware(Protocol):
    """A method that uses knowledge of its source of reaches; OMEGA uses the success model of that source."""

    def for_source(self, reaches: str) -> Method:
        """The method for a source of reaches; its settings name what it uses, so that they create it again."""
        ...


Entrant: TypeAlias = Method | Learner | PolicyTransfer


def find_method(text: str) -> type[Entrant]:
    """The class of a method named by its name, `module:Class` or `file.py:Class`.

    Raises UnknownMethod if there is none; the message lists the installed methods.
    """
    try:
        spec = specs.parse(text)
    except specs.BadSpec as error:
        raise UnknownMethod(str(error)) from error
    return _checked(text, loading.load_class(spec))


def create(text: str, settings: Settings | None = None, reaches: str = "") -> Entrant:
    """The method with these settings and its defaults, for a source of reaches if one is given.

    Raises UnknownMethod, BadSettings if the method refuses the settings, AgentError if its code raises another error.
    """
    cls = find_method(text)
    with _as_bad_settings(text):
        method = cls(**(settings or {}))
        if reaches and isinstance(method, SourceAware):
            method = method.for_source(reaches)
        method_settings.remember(method, settings or {})
        run_label = label(method)
        _read_length(method)
    if not isinstance(run_label, str) or not NAME.fullmatch(run_label):
        raise UnknownMethod(f"{text!r} has the label {run_label!r}: use letters, digits and . _ + -, as in 'rlil-0.1'")
    return method


def paper_methods(preset: str) -> list[tuple[str, Settings]]:
    """The methods of the paper's figure 4a with their settings; `preset` sets how long the learners train."""
    return [
        (name, {**settings, **({"preset": preset} if hasattr(find_method(name), "preset") else {})})
        for name, settings in PAPER_METHODS
    ]


def as_flags(text: str, settings: Settings) -> str:
    """The command-line flags of a method with settings; settings equal to their defaults are left out."""
    cls = method_settings.settings_class(find_method(text))
    defaults = {field.name: method_settings.default(field) for field in fields(cls)} if cls else {}
    flags = [as_flag(name, value) for name, value in settings.items() if value != defaults.get(name)]
    return " ".join([f"--method {text}", *flags])


def as_flag(name: str, value: object) -> str:
    """The words of the command line that give a setting a value."""
    flag = name.replace("_", "-")
    if isinstance(value, bool):
        return f"--{flag}" if value else f"--no-{flag}"
    values = value if isinstance(value, (tuple, list)) else [value]
    return " ".join([f"--{flag}", *(shlex.quote(str(one)) for one in values)])


def label(method: Entrant) -> str:
    """The name of a method's runs and rows: its `label`, or else its `name` and the settings that are not the defaults.

    An agent `mine` with `near` 0.06 has the label "mine-near0.06". A value that cannot be a part of a file's name gives
    the first digits of its hash. A field with the metadata `{"in_label": False}` is left out.
    """
    named = getattr(method, "label", None)
    return method.name + method_settings.in_label(method) if named is None else named


def run_source(method: Entrant, reaches: str) -> str:
    """The source of reaches of a method's run: the learner's `train_source` if it has one, else `reaches`."""
    return (getattr(method, "train_source", "") if isinstance(method, Learner) else "") or reaches


def describe(name: str) -> str:
    """The first line of an installed method's docstring, or why the method cannot be used."""
    try:
        return (find_method(name).__doc__ or "").strip().partition("\n")[0]
    except UnknownMethod as error:
        return str(error)


def run_config(method: Entrant, reaches: str, seed: int) -> dict[str, Json]:
    """Everything that a method's run depends on: the content of its `config.json`."""
    return {
        "method": method.name,
        "code": loading.class_origin(type(method)),
        "settings": settings_of(method),
        "reaches": reaches,
        "seed": seed,
        "physics": model.mjcf_hash(),
    }


def package_files(cls: type) -> list[Path]:
    """The files of the package that a class lies in; if it lies in a file or in a module without package, that file.

    Code that a method loads from elsewhere is not among them.
    """
    module = sys.modules[cls.__module__]
    if not module.__file__:
        return []
    file = Path(module.__file__)
    return visible(file.parent, "*.py") if module.__package__ else [file]


def _read_length(method: Entrant) -> None:
    """Computes what a learner derives from its settings, so that settings which it does not know are refused here."""
    learner = getattr(method, "source_policy", method)
    for name in ("epochs", "period"):
        getattr(learner, name, None)


@contextmanager
def _as_bad_settings(text: str) -> Iterator[None]:
    """Turns a ValueError of a method's code into BadSettings, and its other exceptions into AgentError."""
    try:
        with as_agent_error(f"making method {text!r}"):
            yield
    except AgentError as error:
        if isinstance(error.__cause__, ValueError):
            raise BadSettings(f"method {text!r}: {error.__cause__}") from error
        raise


def _checked(text: str, cls: Any) -> type[Entrant]:
    """The class, if it is a method; raises UnknownMethod."""
    offers = [name for name in ("agent", "trainer", "source_policy") if hasattr(cls, name)]
    if not isinstance(cls, type) or not offers or not hasattr(cls, "name"):
        raise UnknownMethod(
            f"{text!r} is not a method: it needs to be a class with `name` and `agent(seed)`, "
            "or with the members of Learner in dextron_bench/methods/learners.py"
        )
    if not isinstance(cls.name, str) or not NAME.fullmatch(cls.name):
        raise UnknownMethod(f"{text!r} has the name {cls.name!r}: use letters, digits and . _ + -, as in 'my-method'")
    return cls
