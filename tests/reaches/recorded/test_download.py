"""Downloads from a server in this process: complete, truncated, too large, missing."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from dextron_bench.reaches.recorded import cache, download, release
from tests.helpers.small_release import SmallRelease


class Server(BaseHTTPRequestHandler):
    """Serves `content`. For /cut it announces more bytes than it sends."""

    content = b""

    def do_GET(self):
        self.send_response(404 if self.path == "/none" else 200)
        self.send_header("Content-Length", str(len(self.content) + (9 if self.path == "/cut" else 0)))
        self.end_headers()
        self.wfile.write(self.content)

    def log_message(self, format: str, *args: object) -> None:
        """Prints nothing."""


@pytest.fixture
def server_url(small_release: SmallRelease, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("DEXTRON_CACHE", str(small_release.folder / "cache"))
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setattr(Server, "content", small_release.zip().read_bytes())
    server = HTTPServer(("127.0.0.1", 0), Server)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def test_fetch_imports_the_downloaded_release(small_release: SmallRelease, server_url: str):
    reports: list[tuple[int, int]] = []

    def progress(done: int, total: int, note: str = "") -> None:
        reports.append((done, total))

    manifest = release.Manifest.load(small_release.manifest)
    reaches = download.fetch(manifest, progress, url=f"{server_url}/release.zip")
    assert len(reaches) == 3 == len(cache.load_reaches(manifest))
    assert reports[-1] == (len(Server.content), len(Server.content))


@pytest.mark.parametrize(("page", "reason"), [("none", "the server answers 404"), ("cut", "the connection broke")])
def test_the_error_of_a_failed_download_has_the_reason(server_url: str, page: str, reason: str):
    with pytest.raises(download.FetchError, match=reason):
        download.download(f"{server_url}/{page}", io.BytesIO())


def test_a_download_stops_at_its_limit(server_url: str):
    target = io.BytesIO()
    with pytest.raises(download.FetchError, match="has more than 100 bytes"):
        download.download(f"{server_url}/release.zip", target, limit=100)
    assert target.getvalue() == b""
