"""Methods by name: entry points of the group `dextron_bench.methods`, `module:Class` or `file.py:Class`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields, is_dataclass
from importlib.metadata import entry_points
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

from dextron_bench.methods import loading, registry
from dextron_bench.methods.agents import Agent, AgentError, as_agent_error
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.methods.loading import UnknownMethod
from dextron_bench.world import model

GROUP = "dextron_bench.methods"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*")  # A run's folder is called like its method.
PAPER: tuple[tuple[str, dict[str, Any]], ...] = (  # The rows of its figure 4a, which `run --all` makes.
    ("exp", {}),
    ("sim", {}),
    ("sor", {}),
    ("bc", {}),
    ("rl", {}),
    ("rlil", {"dur": 0.1}),
    ("rlil", {"dur": 0.3}),
)
FLOORS = "nothing", "random"  # Methods that decide nothing: what others are to be seen beside.
CEILINGS = ("exp",)  # Methods that are told each setting's own expert: no entrants, but what can be reached.


class Method(Protocol):
    """A way to get an agent. A frozen dataclass whose fields are its settings, each with a default."""

    name: ClassVar[str]

    def agent(self, seed: int) -> Agent:
        """An agent ready to act; equal seeds give agents that act equally."""
        ...


@runtime_checkable
class SourceAware(Protocol):
    """A method that acts by what is known of its source of reaches, as OMEGA does by a model of success there."""

    def for_source(self, reaches: str) -> Method:
        """The method as it acts on that source; its settings, with which it can be made again, say by what."""
        ...


Entrant: TypeAlias = Method | Learner | PolicyTransfer


class BadSettings(ValueError):
    """Settings that a method does not have, or refuses."""


def known() -> tuple[str, ...]:
    """Names of the installed methods."""
    return tuple(sorted(entry_points(group=GROUP).names))


def find(spec: str) -> type[Entrant]:
    """The method's class; raises UnknownMethod with what would be right."""
    if ":" not in spec:
        found = list(entry_points(group=GROUP, name=spec))
        if not found:
            raise UnknownMethod(
                f"no method {spec!r}; choose from {', '.join(known())}, or give module:Class or file.py:Class"
            )
        return _checked(spec, loading.loaded(spec, found[0].load))
    return _checked(spec, loading.find(spec))


def create(spec: str, settings: Mapping[str, Any] | None = None, reaches: str = "") -> Entrant:
    """The method with these settings, defaults elsewhere, for a source of reaches where one is named.

    Raises UnknownMethod, BadSettings, AgentError.
    """
    found = find(spec)
    with _making(spec):
        made = found(**(settings or {}))
        if reaches and isinstance(made, SourceAware):
            made = made.for_source(reaches)
        called = label(made)
    if not isinstance(called, str) or not NAME.fullmatch(called):
        raise UnknownMethod(f"{spec!r} has the label {called!r}: use letters, digits and . _ + -, as in 'rlil-0.1'")
    return made


def paper(preset: str) -> list[tuple[str, dict[str, Any]]]:
    """The methods of the paper's table with their settings; those that train do so for as long as `preset` says."""
    return [
        (spec, settings | ({"preset": preset} if hasattr(find(spec), "preset") else {})) for spec, settings in PAPER
    ]


def words(spec: str, settings: Mapping[str, Any]) -> str:
    """What to write on the command line for a method with settings, those that are its defaults left out."""
    own = {field.name: field.default for field in fields(found)} if is_dataclass(found := find(spec)) else {}
    flags = [f"--{name.replace('_', '-')} {value}" for name, value in settings.items() if value != own.get(name)]
    return " ".join([f"--method {spec}", *flags])


def label(method: Entrant) -> str:
    """What a method's runs and rows are called: its `label`, or its name where it has none."""
    return getattr(method, "label", method.name)


def run_source(method: Entrant, reaches: str) -> str:
    """The source of reaches of a method's run that was asked for on `reaches`."""
    return (getattr(method, "train_source", "") if isinstance(method, Learner) else "") or reaches


def origin(spec: str) -> dict[str, str | None]:
    """Where a method's code is from: its class, and for a file the SHA-256 of its content."""
    return loading.origin(find(spec))


def describe(name: str) -> str:
    """What an installed method is, in a line, or why it cannot be used."""
    try:
        return (find(name).__doc__ or "").strip().partition("\n")[0]
    except UnknownMethod as error:
        return str(error)


def settings(method: Entrant) -> dict[str, Any]:
    """A method's settings as plain values."""
    return asdict(method) if is_dataclass(method) and not isinstance(method, type) else {}


@contextmanager
def _making(spec: str) -> Iterator[None]:
    """Makes an entrant's ValueError BadSettings, and what else its code raises an AgentError."""
    try:
        with as_agent_error(f"making method {spec!r}"):
            yield
    except AgentError as error:
        if isinstance(error.__cause__, ValueError):
            raise BadSettings(f"method {spec!r}: {error.__cause__}") from error
        raise


def _checked(spec: str, found: Any) -> type[Entrant]:
    offers = [name for name in ("agent", "trainer", "source_policy") if hasattr(found, name)]
    if not isinstance(found, type) or not offers or not hasattr(found, "name"):
        raise UnknownMethod(
            f"{spec!r} is not a method: it needs to be a class with `name` and `agent(seed)`, "
            "or what dextron_bench/methods/learners.py asks of one that trains"
        )
    if not isinstance(found.name, str) or not NAME.fullmatch(found.name):
        raise UnknownMethod(f"{spec!r} has the name {found.name!r}: use letters, digits and . _ + -, as in 'my-method'")
    return found


def config(method: registry.Entrant, reaches: str, seed: int) -> dict[str, Any]:
    """What a method's run depends on, as `config.json` says it."""
    return {
        "method": method.name,
        "code": loading.origin(type(method)),
        "settings": registry.settings(method),
        "reaches": reaches,
        "seed": seed,
        "physics": model.mjcf_hash(),
    }
