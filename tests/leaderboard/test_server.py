"""The leaderboard's server: what it serves, to whom, and what it refuses."""

from __future__ import annotations

import re
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from http.client import HTTPConnection, HTTPResponse
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from dextron_bench.leaderboard import server as leaderboard_server
from dextron_bench.web.local_server import LOOPBACK

PAGE = '<a href="../recordings/a%2Bb-success.rrd">success</a>'


@pytest.fixture
def server(tmp_path: Path) -> Iterator[leaderboard_server.Server]:
    """A server of a folder with one recording, a symbolic link that leads out of it, and a secret file outside."""
    for folder in ("board", "recordings"):
        (tmp_path / folder).mkdir()
    (tmp_path / "board/index.html").write_text(PAGE)
    (tmp_path / "recordings/a+b-success.rrd").write_bytes(b"RRF2")
    (tmp_path / "secret.rrd").write_text("secret")
    (tmp_path / "recordings/link.rrd").symlink_to(tmp_path / "secret.rrd")
    (tmp_path / "recordings/notes.txt").write_text("notes")
    with leaderboard_server.Server(
        leaderboard_server.Site(tmp_path / "board", {"index.html": ("text/html", b"viewer")}), 0
    ) as opened:
        thread = threading.Thread(target=opened.serve_forever, daemon=True)
        thread.start()
        yield opened
        opened.shutdown()
        thread.join()


@pytest.fixture
def ask(server: leaderboard_server.Server) -> Callable[..., tuple[HTTPResponse, bytes]]:
    """Sends a request with an unchanged path and returns the response and its body."""

    def ask(path: str, method: str = "GET", host: str | None = None) -> tuple[HTTPResponse, bytes]:
        connection = HTTPConnection(LOOPBACK, server.server_port, timeout=5)
        connection.putrequest(method, path, skip_host=True)
        if host != "":
            connection.putheader("Host", host or f"127.0.0.1:{server.server_port}")
        connection.endheaders()
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
        return answer, body

    return ask


def test_the_page_and_recordings_are_served(
    server: leaderboard_server.Server, ask: Callable[..., tuple[HTTPResponse, bytes]]
):
    answer, body = ask("/")
    assert (answer.status, answer.headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    link = re.search(r'href="/viewer/\?url=([^"]+)"', body.decode())
    assert link
    assert unquote(link[1]) == f"http://127.0.0.1:{server.server_port}/recordings/a%2Bb-success.rrd"
    assert ask("/recordings/a+b-success.rrd")[1] == ask("/recordings/a%2Bb-success.rrd")[1] == b"RRF2"
    answer, body = ask("/viewer/?url=whatever")
    assert body == b"viewer"
    assert "connect-src 'self'" in answer.headers["Content-Security-Policy"]


def test_code_of_submissions_is_served_as_text_and_nothing_else_of_the_results(
    server: leaderboard_server.Server, ask: Callable[..., tuple[HTTPResponse, bytes]]
):
    place = server.site.board / "results/a+b/synthetic"
    (place / "agent").mkdir(parents=True)
    (place / "agent/mine.py").write_text("<script>")
    (place / "bundle.json").write_text("{}")
    (place / "agent/link.py").symlink_to(place / "bundle.json")
    answer, body = ask("/results/a%2Bb/synthetic/agent/mine.py")
    assert (answer.headers["Content-Type"], body) == ("text/plain", b"<script>")
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    refused = ("bundle.json", "agent/", "agent/link.py", "agent/../bundle.json", "agent/..%2Fbundle.json")
    assert [ask(f"/results/a+b/synthetic/{path}")[0].status for path in refused] == [404] * len(refused)


def test_without_a_viewer_recordings_are_downloaded(
    server: leaderboard_server.Server, ask: Callable[..., tuple[HTTPResponse, bytes]]
):
    server.site.viewer.clear()
    assert ask("/")[1].decode() == PAGE
    assert ask("/viewer/")[0].status == 404


@pytest.mark.parametrize(
    "path",
    [
        *("/recordings/../secret.rrd", "/recordings/..%2fsecret.rrd", "/recordings/%2e%2e/secret.rrd", "/secret.rrd"),
        *("/recordings/link.rrd", "/recordings/", "/recordings", "/recordings/notes.txt", "/results/", "//secret.rrd"),
        *("/viewer/../index.html", "/viewer/none", "/..", "http://evil.example/", "/recordings/a\x00.rrd", "*"),
    ],
)
def test_nothing_else_is_served(
    path: str, ask: Callable[..., tuple[HTTPResponse, bytes]], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(HTTPConnection, "_validate_path", lambda *_: None)
    answer, body = ask(path)
    assert answer.status == 404
    assert b"secret" not in body.replace(b"secret.rrd", b"")


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", "", "[::1]"])
def test_another_host_name_is_refused(host: str, ask: Callable[..., tuple[HTTPResponse, bytes]]):
    """Otherwise a site could read recordings by pointing its name at this machine (DNS rebinding)."""
    answer, body = ask("/recordings/a+b-success.rrd", host=host)
    assert answer.status == 403
    assert b"RRF2" not in body


def test_requests_that_write_are_refused(ask: Callable[..., tuple[HTTPResponse, bytes]]):
    answer, body = ask("/", method="HEAD")
    assert (answer.status, body) == (200, b"")
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert ask("/", method=method)[0].status == 501


def test_other_machines_cannot_connect(server: leaderboard_server.Server):
    assert server.server_address[0] == "127.0.0.1"
    with socket.socket() as other:
        other.settimeout(2)
        assert (
            other.connect_ex(("127.0.0.2", server.server_port)) != 0
        )  # An address of this machine that the server does not listen on.


def test_a_folder_without_a_page_is_one_line(tmp_path: Path, complaint: Callable[..., str]):
    line = complaint("leaderboard", "serve", "--board", str(tmp_path))
    assert "has no index.html; `dextron-bench leaderboard build --board" in line


SERVED = """
import signal
from dextron_bench.cli.main import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # The process that started the tests may have disabled it.
raise SystemExit(main(["leaderboard", "serve", "--port", "0"]))
"""


@pytest.mark.slow
def test_the_server_serves_the_viewer_until_it_is_interrupted():
    command = [sys.executable, "-c", SERVED]
    root = Path(__file__).parents[2]
    with subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout
        port = int(process.stdout.readline().strip().rpartition(":")[2].strip("/"))
        connection = HTTPConnection(LOOPBACK, port, timeout=10)
        connection.request("GET", "/viewer/re_viewer_bg.wasm")
        answer = connection.getresponse()
        assert (answer.status, answer.headers["Content-Type"]) == (200, "application/wasm")
        assert answer.read(4) == b"\0asm"
        connection.close()
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(30) == 130
        finally:
            process.kill()


def test_a_client_that_hangs_up_is_no_traceback(
    server: leaderboard_server.Server,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
):
    """The client resets its connection before it reads a large recording."""
    (tmp_path / "recordings/large.rrd").write_bytes(bytes(30_000_000))
    met = threading.Event()
    original = server.handle_error

    def handle_error(*connection: Any) -> None:
        original(*connection)
        met.set()

    monkeypatch.setattr(server, "handle_error", handle_error)
    client = socket.create_connection((LOOPBACK, server.server_port))
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # Resets when it is closed.
    client.sendall(f"GET /recordings/large.rrd HTTP/1.1\r\nHost: 127.0.0.1:{server.server_port}\r\n\r\n".encode())
    client.recv(1)
    client.close()
    assert met.wait(10.0)
    assert capfd.readouterr().err == ""
