"""How the leaderboard's page looks: contrast in light and dark, on any width, on paper."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.helpers.browser import visit
from tests.leaderboard.page.test_document import ALL, PUBLISHED


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_in_light_and_dark(browser: Any, scheme: Any):
    with visit(browser, ALL, color_scheme=scheme) as opened:
        canvas = luminance(opened.evaluate("getComputedStyle(document.body).backgroundColor"))
        assert (canvas < 0.02) == (scheme == "dark")
        for where in (
            "p",
            "td",
            "th",
            "small",
            "a",
            ".tier",
            ".mark",
            ".range",
            ".heat td",
            "caption",
            "figure svg text",
        ):
            pairs = opened.eval_on_selector_all(where, LOOKS)
            assert pairs
            assert min(contrast(*pair) for pair in pairs) >= 4.5, where  # WCAG AA


LOOKS = """found => {
  const draw = document.createElement("canvas").getContext("2d", {willReadFrequently: true});
  const plain = colour => {
    draw.fillStyle = colour;
    draw.fillRect(0, 0, 1, 1);
    return `rgb(${[...draw.getImageData(0, 0, 1, 1).data].slice(0, 3)})`;
  };
  const looks = element => {
    const own = getComputedStyle(element);
    let behind = element;
    while (getComputedStyle(behind).backgroundColor === "rgba(0, 0, 0, 0)") behind = behind.parentElement;
    return [element.closest("svg") ? own.fill : own.color, getComputedStyle(behind).backgroundColor].join("|");
  };
  return [...new Set(found.map(looks))].map(pair => pair.split("|").map(plain));
}"""


def luminance(colour: str) -> float:
    """Relative luminance of `rgb(r, g, b)`, as WCAG has it."""
    parts = [int(each) / 255 for each in re.findall(r"\d+", colour)[:3]]
    linear = [each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4 for each in parts]
    return sum(weight * each for weight, each in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one: str, other: str) -> float:
    bright, dim = sorted((luminance(one), luminance(other)), reverse=True)
    return (bright + 0.05) / (dim + 0.05)


@pytest.mark.parametrize("width", [320, 390, 768, 1280])
def test_the_page_is_never_wider_than_the_screen(browser: Any, width: int):
    with visit(browser, ALL, viewport={"width": width, "height": 800}) as opened:
        assert opened.evaluate("document.documentElement.scrollWidth") == width


def test_on_paper_there_are_no_controls_and_nothing_is_cut_off(browser: Any):
    with visit(browser, PUBLISHED, viewport={"width": 1030, "height": 700}) as opened:
        opened.emulate_media(media="print")
        assert not opened.locator(".controls").is_visible()
        assert opened.evaluate("document.documentElement.scrollWidth") <= 1030
