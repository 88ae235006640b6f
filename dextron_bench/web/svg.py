"""Draws small SVGs (an estimate with its interval, shares of a whole) and embeds the SVGs of matplotlib."""

from __future__ import annotations

import re
from collections.abc import Iterable

from dextron_bench.web.html import Html, tag

WIDTH, HEIGHT, MARGIN = 168, 16, 4  # Of an estimate's drawing; a score of 0 is MARGIN from its left.
INK = re.compile(r"#010203|#000000|#333333")  # Replaced by the colour of the page's text.
LONG_NUMBER = re.compile(r"-?\d+\.\d{4,}")
DROPPED = re.compile(r"<metadata>.*?</metadata>|<!--.*?-->|<style.*?</style>", re.DOTALL)
ID = re.compile(r'\bid="([^"]*)"')
REFERENCE = re.compile(r'(\bid="|href="#|url\(#)([^")]*)')  # An id, or what refers to one.
PATH = re.compile(r'\bd="(M[^"]*)"')


def estimate(value: float, low: float | None, high: float | None, top: float) -> Html:
    """A mark at a value from 0 to `top` and a bar over its interval; hidden from screen readers."""
    middle, bottom = HEIGHT // 2, HEIGHT - 1
    parts = [tag("line", class_="rail", x1=MARGIN, x2=WIDTH - MARGIN, y1=middle, y2=middle)]
    ticks = map(_x, (0.0, 0.25, 0.5, 0.75, 1.0))
    parts += [tag("line", class_="rail", x1=x, x2=x, y1=bottom - 2, y2=bottom) for x in ticks]
    if low is not None and high is not None:
        left, right = float(_x(low / top)), float(_x(high / top))
        width = f"{max(right - left, 1.0):.1f}"
        parts.append(tag("rect", class_="interval", x=_x(low / top), y=middle - 3, width=width, height=6, rx=2))
    parts.append(
        tag("rect", class_="mean", x=f"{float(_x(value / top)) - 1.25:.2f}", y=middle - 6, width=2.5, height=12)
    )
    return _svg("estimate", WIDTH, HEIGHT, parts)


def shares(parts: Iterable[tuple[str, float]]) -> Html:
    """A bar of named shares of 1, one after another; share number n has the class `cn`."""
    groups, left = [], 0.0
    for number, (name, share) in enumerate(parts):
        if share > 0:
            title = tag("title", f"{name}: {100 * share:.1f} %")
            rect = tag("rect", class_=f"c{number}", x=f"{1000 * left:.1f}", width=f"{1000 * share:.1f}", height=10)
            groups.append(tag("g", rect, title))
        left += share
    return _svg("shares", 1000, 10, groups, preserveAspectRatio="none")


def picture(svg: str, name: str, label: str) -> Html:
    """Makes an SVG of matplotlib a part of the page: its ids start with `name`, its text has the page's colour."""
    body = DROPPED.sub("", svg[svg.index("<svg") :])
    body = INK.sub("currentColor", LONG_NUMBER.sub(lambda match: f"{float(match[0]):.1f}", body))
    body = PATH.sub(lambda match: f'd="{_simplified(match[1])}"', body)
    body = _numbered(body, name)
    box = re.search(r'viewBox="[^"]+"', body)
    opening = tag("svg", role="img", aria_label=label, focusable="false")[: -len("></svg>")]
    return Html(f"{opening} {box[0] if box else ''}>{body[body.index('>') + 1 :].strip()}")


def _numbered(body: str, name: str) -> str:
    """An SVG with ids `name`-0, `name`-1, ...: matplotlib makes its ids from the last bits of a layout."""
    numbers = {identity: number for number, identity in enumerate(dict.fromkeys(ID.findall(body)))}
    return REFERENCE.sub(lambda match: f"{match[1]}{name}-{numbers.get(match[2], match[2])}", body)


def _simplified(path: str) -> str:
    """A path of lines without the inner points of its level parts, which are most points of a ridge plot."""
    tokens = path.split()
    points = [tuple(tokens[start : start + 3]) for start in range(0, len(tokens) - len(tokens) % 3, 3)]
    if any(command not in "ML" for command, *_ in points) or tokens[3 * len(points) :] not in ([], ["z"]):
        return path
    triples = zip([None, *points], points, [*points[1:], None], strict=False)
    kept = [point for before, point, after in triples if not (before and after and _is_level(before, point, after))]
    return " ".join(" ".join(point) for point in kept) + " ".join(["", *tokens[3 * len(points) :]])


def _is_level(before: tuple[str, ...], point: tuple[str, ...], after: tuple[str, ...]) -> bool:
    """True if three points have the same height and the path does not turn back."""
    forward = (float(point[1]) - float(before[1])) * (float(after[1]) - float(point[1])) >= 0.0
    return point[0] == after[0] == "L" and before[2] == point[2] == after[2] and forward


def _x(share: float) -> str:
    return f"{MARGIN + (WIDTH - 2 * MARGIN) * share:.1f}"


def _svg(kind: str, width: int, height: int, parts: Iterable[Html], **attributes: str) -> Html:
    return tag("svg", *parts, class_=kind, viewBox=f"0 0 {width} {height}", aria_hidden="true", **attributes)
