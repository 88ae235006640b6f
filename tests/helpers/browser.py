"""A headless browser for tests of pages, which notes what a page asks for and complains of."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

NAMES = "chromium", "chromium-browser", "google-chrome"
FOUND = next(filter(None, map(shutil.which, NAMES)), None)


@contextmanager
def open_browser() -> Iterator[Any]:
    """A browser; skips where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install -e '.[dev]'")
    if FOUND is None:
        pytest.skip(f"no browser is here; one of {', '.join(NAMES)} is needed (Debian: apt-get install chromium)")
    with api.sync_playwright() as playwright:
        words = ["--no-sandbox"] if os.geteuid() == 0 else []
        opened = playwright.chromium.launch(executable_path=FOUND, args=words)
        yield opened
        opened.close()


@contextmanager
def visit(browser: Any, address: str, **settings: Any) -> Iterator[Any]:
    """The page at an address; when the block ends, it has said nothing and asked for nothing from elsewhere."""
    context = browser.new_context(**settings)
    page, complaints, asked = context.new_page(), [], []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(address)
    yield page
    context.close()
    assert complaints == []
    assert [url for url in asked if url.partition("#")[0] != address.partition("#")[0]] == []
