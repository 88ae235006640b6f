"""Small drawings in SVG: an estimate with its interval, shares of a whole, and pictures of matplotlib's."""

from __future__ import annotations

import re
from collections.abc import Iterable

from dextron_bench.leaderboard.page.html import Html, tag

WIDTH, HEIGHT, EDGE = 168, 16, 4  # Of an estimate's drawing; a score of 0 is EDGE from its left.
OWN_INK = re.compile(r"#010203|#000000|#333333")
LONG = re.compile(r"-?\d+\.\d{4,}")
DROPPED = re.compile(r"<metadata>.*?</metadata>|<!--.*?-->|<style.*?</style>", re.DOTALL)
PATH = re.compile(r'\bd="(M[^"]*)"')


def estimate(value: float, low: float | None, high: float | None, top: float) -> Html:
    """A dot at a value from 0 to `top` and a bar over its interval; who hears the page has the numbers beside it."""
    middle, floor = HEIGHT // 2, HEIGHT - 1
    parts = [tag("line", class_="rail", x1=EDGE, x2=WIDTH - EDGE, y1=middle, y2=middle)]
    ticks = map(_x, (0.0, 0.25, 0.5, 0.75, 1.0))
    parts += [tag("line", class_="rail", x1=x, x2=x, y1=floor - 2, y2=floor) for x in ticks]
    if low is not None and high is not None:
        left, right = float(_x(low / top)), float(_x(high / top))
        width = f"{max(right - left, 1.0):.1f}"
        parts.append(tag("rect", class_="interval", x=_x(low / top), y=middle - 3, width=width, height=6, rx=2))
    parts.append(
        tag("rect", class_="mean", x=f"{float(_x(value / top)) - 1.25:.2f}", y=middle - 6, width=2.5, height=12)
    )
    return _svg("estimate", WIDTH, HEIGHT, parts)


def shares(parts: Iterable[tuple[str, float]]) -> Html:
    """A bar of named shares of 1, one after the other; the n-th has the class `cn`."""
    drawn, left = [], 0.0
    for place, (name, share) in enumerate(parts):
        if share > 0:
            told = tag("title", f"{name}: {100 * share:.1f} %")
            rect = tag("rect", class_=f"c{place}", x=f"{1000 * left:.1f}", width=f"{1000 * share:.1f}", height=10)
            drawn.append(tag("g", rect, told))
        left += share
    return _svg("shares", 1000, 10, drawn, preserveAspectRatio="none")


def picture(svg: str, name: str, label: str) -> Html:
    """An SVG file of matplotlib's as part of the page: its ids begin with `name`, its ink is the page's."""
    body = DROPPED.sub("", svg[svg.index("<svg") :])
    body = OWN_INK.sub("currentColor", LONG.sub(lambda found: f"{float(found[0]):.1f}", body))
    body = PATH.sub(lambda found: f'd="{_shortened(found[1])}"', body)
    body = re.sub(r'\bid="', f'id="{name}-', body)
    body = re.sub(r'href="#', f'href="#{name}-', body).replace("url(#", f"url(#{name}-")
    box = re.search(r'viewBox="[^"]+"', body)
    opening = tag("svg", role="img", aria_label=label, focusable="false")[: -len("></svg>")]
    return Html(f"{opening} {box[0] if box else ''}>{body[body.index('>') + 1 :].strip()}")


def _shortened(path: str) -> str:
    """A path of lines without the points between others of their height, which are most of a ridge plot's."""
    words = path.split()
    points = [tuple(words[place : place + 3]) for place in range(0, len(words) - len(words) % 3, 3)]
    if any(command not in "ML" for command, *_ in points) or words[3 * len(points) :] not in ([], ["z"]):
        return path
    around = zip([None, *points], points, [*points[1:], None], strict=False)
    kept = [each for before, each, after in around if not (before and after and _level(before, each, after))]
    return " ".join(" ".join(each) for each in kept) + " ".join(["", *words[3 * len(points) :]])


def _level(before: tuple[str, ...], point: tuple[str, ...], after: tuple[str, ...]) -> bool:
    """Whether a point lies on its way, which turns back nowhere."""
    forth = (float(point[1]) - float(before[1])) * (float(after[1]) - float(point[1])) >= 0.0
    return point[0] == after[0] == "L" and before[2] == point[2] == after[2] and forth


def _x(share: float) -> str:
    return f"{EDGE + (WIDTH - 2 * EDGE) * share:.1f}"


def _svg(kind: str, width: int, height: int, parts: Iterable[Html], **more: str) -> Html:
    return tag("svg", *parts, class_=kind, viewBox=f"0 0 {width} {height}", aria_hidden="true", **more)
