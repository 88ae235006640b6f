"""HTML that is safe by construction: whatever is text is escaped, since names of methods come from strangers."""

from __future__ import annotations

from html import escape

VOID = {"line", "rect"}  # Of SVG, whose elements need an end; the page has none of HTML's.


class Html(str):
    """Text that is HTML already."""


Content = str | int | float | None
UNKNOWN = "\N{EN DASH}"


def tag(name: str, /, *contents: Content, **attributes: Content) -> Html:
    """An element. Contents that are not Html are escaped and None is nothing; so are attributes, "" for a bare one.

    A trailing underscore of an attribute's name is dropped (`class_`), others are hyphens (`data_value`).
    """
    words = " ".join([name, *(_attribute(key, value) for key, value in attributes.items() if value is not None)])
    return Html(f"<{words}/>" if name in VOID else f"<{words}>{join(*contents)}</{name}>")


def join(*contents: Content) -> Html:
    """Contents one after the other."""
    return Html("".join(each if isinstance(each, Html) else escape(str(each)) for each in contents if each is not None))


def _attribute(key: str, value: Content) -> str:
    name = key.rstrip("_").replace("_", "-")
    return name if value == "" else f'{name}="{escape(str(value))}"'
