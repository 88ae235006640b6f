"""Builds HTML and escapes all text, because names of methods come from strangers."""

from __future__ import annotations

from html import escape
from importlib.resources import files

from dextron_bench.storage.printable import printable

VOID = {"line", "rect", "img", "input"}  # Elements that are written without an end tag.


class Html(str):
    """Text that is already HTML and is not escaped again."""


Content = str | int | float | None
UNKNOWN = "\N{EN DASH}"


def tag(name: str, /, *contents: Content, **attributes: Content) -> Html:
    """An element. Contents that are not Html are escaped and None is left out, also in attributes; "" is a bare one.

    A trailing underscore of an attribute's name is dropped (`class_`), other underscores become hyphens (`data_value`).
    """
    start = " ".join([name, *(_attribute(key, value) for key, value in attributes.items() if value is not None)])
    return Html(f"<{start}/>" if name in VOID else f"<{start}>{join(*contents)}</{name}>")


def join(*contents: Content) -> Html:
    """Concatenates contents: escapes those that are not Html and leaves out None."""
    return Html("".join(part if isinstance(part, Html) else _escape(part) for part in contents if part is not None))


def style() -> Html:
    """The style of all pages."""
    return Html(files("dextron_bench.web").joinpath("page.css").read_text(encoding="utf-8"))


def _escape(value: Content) -> str:
    return escape(printable(str(value)))


def _attribute(key: str, value: Content) -> str:
    name = key.rstrip("_").replace("_", "-")
    return name if value == "" else f'{name}="{_escape(value)}"'
