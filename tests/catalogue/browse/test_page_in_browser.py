"""The page in headless Chromium: search, pictures, the phone's width, and a recording in Rerun's web viewer."""

from __future__ import annotations

import io
import time
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dextron_bench.recording import web_viewer_files
from dextron_bench.web.local_server import LocalServer

PATIENCE = 180  # [s] for making a recording and drawing it; software rendering takes about 30 s.
GRASP_VIEW = slice(80, 300), slice(20, 580)  # Rows and columns of the screen [pixels] where the layout has the hand.
DARK = 60  # Brightness below which a pixel belongs to the dark background of that view.
WIDTHS = "[...document.images].map((image) => image.naturalWidth)"

pytestmark = pytest.mark.slow


@pytest.fixture
def viewer() -> dict[str, tuple[str, bytes]]:
    return web_viewer_files()


@pytest.mark.slow
def test_an_episode_is_searched_and_opened(server: LocalServer, browser: Any):
    complaints, asked = [], []
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.set_default_timeout(1000 * PATIENCE)
    page.on("console", lambda message: complaints.append(message.text))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(server.address)
    assert page.inner_text("#count") == "4 of 4 episodes"
    page.fill("input[name=where]", "method == 'nothing' and return < 5")
    page.click("text=search")
    assert page.inner_text("#count") == "2 of 4 episodes"
    deadline = time.monotonic() + PATIENCE
    while page.evaluate(WIDTHS) != [320, 320] and time.monotonic() < deadline:
        page.wait_for_timeout(500)
    assert page.evaluate(WIDTHS) == [320, 320]
    page.click(".causes a")
    assert "and cause == " in page.input_value("input[name=where]")
    assert complaints == []
    assert [url for url in asked if not url.startswith((server.address, "data:"))] == []
    page.click("article button")
    assert "/viewer/?url=" in page.url
    deadline, dark = time.monotonic() + PATIENCE, 0.0
    while dark < 0.9 and time.monotonic() < deadline:
        page.wait_for_timeout(3000)
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        dark = float((np.asarray(picture)[GRASP_VIEW].max(axis=2) < DARK).mean())
    page.close()
    assert dark >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1400])
def test_nothing_is_wider_than_the_screen(server: LocalServer, browser: Any, width: int):
    page = browser.new_page(viewport={"width": width, "height": 800})
    page.goto(f"{server.address}?where={'caus' * 60}")
    page.click("summary")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.get_by_role("alert").is_visible()
    page.close()
