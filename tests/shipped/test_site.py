"""The documentation site builds in strict mode, defects fail the build, and pages load nothing from another host."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.helpers.browser import open_browser

ROOT = Path(__file__).parents[2]
EXTRA = ("material", "mkdocstrings_handlers")
PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1440, "height": 900}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not all(map(find_spec, EXTRA)), reason="the extra is not installed: pip install -e '.[docs]'"),
]


def build(root: Path, site: Path) -> subprocess.CompletedProcess[str]:
    """Builds the site of a checkout as `make docs` does."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(site)]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1", "SITE_URL": ""}
    return subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site."""
    folder = tmp_path_factory.mktemp("site")
    built = build(ROOT, folder)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A copy of what the site is built from, to be spoiled."""
    unused = shutil.ignore_patterns("__pycache__", "results", "weights")
    for name in ("docs", "dextron_bench", "baselines", "examples", "leaderboard", "recordings", "tests"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=unused)
    for file in ROOT.iterdir():
        if file.is_file():
            shutil.copy(file, tmp_path)
    return tmp_path


def append(file: Path, text: str) -> None:
    """Adds text to the end of a file."""
    file.write_text(file.read_text(encoding="utf-8") + text, encoding="utf-8")


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder without a log."""

    def log_message(self, format: str, *args: object) -> None:
        """Prints nothing."""


@pytest.fixture
def address(site: Path) -> Iterator[str]:
    """Where the site is served on this machine."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


def test_strict_mode_reports_every_kind_of_defect(checkout: Path):
    page = checkout / "docs" / "world.md"
    append(page, "\n[a](nowhere.md) [b](../tests/nowhere.py) [c](splits.md#nowhere)\n")
    append(page, '\n<p><a href="nowhere.html">d</a><img src="https://example.com/e.png"></p>\n')
    append(checkout / "dextron_bench" / "world" / "task.py", "\n\ndef undescribed() -> None:\n    return None\n")
    reference = checkout / "docs" / "reference" / "evaluation.md"
    reference.write_text(
        reference.read_text(encoding="utf-8").replace("::: dextron_bench.diagnose\n", ""), encoding="utf-8"
    )
    built = build(checkout, checkout / "site")
    assert built.returncode != 0
    for warning in (
        "link 'nowhere.md'",
        "'../tests/nowhere.py'",
        "'splits.md#nowhere'",
        "world.html has a broken link: nowhere.html",
        "world.html loads https://example.com/e.png from another host",
        "dextron_bench.world.task.undescribed has no docstring",
        "no page of the reference shows dextron_bench.diagnose",
    ):
        assert warning in built.stderr


def test_pages_ask_this_server_alone_and_fit_a_phone(site: Path, address: str, thorough: bool):
    """All pages with `--thorough`, else every fourth."""
    pages = [file.relative_to(site).as_posix() for file in sorted(site.rglob("*.html"))][:: 1 if thorough else 4]
    requests: list[str] = []
    errors: list[str] = []
    with open_browser() as browser:
        page = browser.new_page(viewport=PHONE)
        page.on("request", lambda request: requests.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        for name in pages:
            page.goto(address + name)
            width = page.evaluate("document.documentElement.scrollWidth")
            assert width <= PHONE["width"] or name.startswith("repository/leaderboard/index"), name
        page.set_viewport_size(DESKTOP)
        page.goto(address + "index.html")
        page.locator(".md-search__input").click()
        page.keyboard.type("countdown")
        page.locator(".md-search-result__item").first.wait_for()
    assert len(pages) > (30 if thorough else 10)
    assert errors == []
    assert {url for url in requests if not url.startswith((address, "data:", "blob:"))} == set()
