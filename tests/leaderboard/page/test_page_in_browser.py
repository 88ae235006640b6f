"""The look of the leaderboard's page: contrast in light and dark, width on any screen, print."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.helpers.browser import visit
from tests.leaderboard.page.test_document import ALL, PUBLISHED


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_enough_contrast_in_light_and_dark(browser: Any, scheme: Any):
    with visit(browser, ALL, color_scheme=scheme) as opened:
        canvas = luminance(opened.evaluate("getComputedStyle(document.body).backgroundColor"))
        assert (canvas < 0.02) == (scheme == "dark")
        for selector in (
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
            pairs = opened.eval_on_selector_all(selector, COLOURS)
            assert pairs
            assert min(contrast(*pair) for pair in pairs) >= 4.5, selector  # WCAG AA


COLOURS = """elements => {
  const draw = document.createElement("canvas").getContext("2d", {willReadFrequently: true});
  const plain = colour => {
    draw.fillStyle = colour;
    draw.fillRect(0, 0, 1, 1);
    return `rgb(${[...draw.getImageData(0, 0, 1, 1).data].slice(0, 3)})`;
  };
  const colours = element => {
    const style = getComputedStyle(element);
    let parent = element;
    while (getComputedStyle(parent).backgroundColor === "rgba(0, 0, 0, 0)") parent = parent.parentElement;
    return [element.closest("svg") ? style.fill : style.color, getComputedStyle(parent).backgroundColor].join("|");
  };
  return [...new Set(elements.map(colours))].map(pair => pair.split("|").map(plain));
}"""


def luminance(colour: str) -> float:
    """Relative luminance of `rgb(r, g, b)`, by the formula of WCAG."""
    channels = [int(number) / 255 for number in re.findall(r"\d+", colour)[:3]]
    linear = [value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in channels]
    return sum(weight * value for weight, value in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one: str, other: str) -> float:
    bright, dim = sorted((luminance(one), luminance(other)), reverse=True)
    return (bright + 0.05) / (dim + 0.05)


@pytest.mark.parametrize("width", [320, 390, 768, 1280])
def test_the_page_is_never_wider_than_the_screen(browser: Any, width: int):
    with visit(browser, ALL, viewport={"width": width, "height": 800}) as opened:
        assert opened.evaluate("document.documentElement.scrollWidth") == width


def test_print_has_no_controls_and_cuts_nothing_off(browser: Any):
    with visit(browser, PUBLISHED, viewport={"width": 1030, "height": 700}) as opened:
        opened.emulate_media(media="print")
        assert not opened.locator(".controls").is_visible()
        assert opened.evaluate("document.documentElement.scrollWidth") <= 1030


def test_a_part_that_goes_on_to_the_right_fades_there_until_it_is_scrolled_to_its_end(browser: Any):
    with visit(browser, PUBLISHED, viewport={"width": 1400, "height": 800}) as opened:
        standings = opened.locator(".scroll.wide")
        assert standings.evaluate("part => getComputedStyle(part).maskImage") != "none"
        standings.evaluate("part => part.scrollTo(part.scrollWidth, 0)")
        opened.wait_for_selector(".scroll.wide:not(.more)")
        assert standings.evaluate("part => getComputedStyle(part).maskImage") == "none"


@pytest.mark.slow
def test_on_a_phone_the_legend_stays_while_its_tables_scroll_by(browser: Any):
    with visit(browser, PUBLISHED, viewport={"width": 390, "height": 800}) as opened:
        opened.evaluate("document.querySelector('.legend').scrollIntoView(); scrollBy(0, 150)")
        top = opened.evaluate("document.querySelector('.legend').getBoundingClientRect().top")
        assert -1 <= top <= 1
