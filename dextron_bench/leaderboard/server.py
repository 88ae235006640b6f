"""Serves the leaderboard's page on this machine only, with recordings in Rerun's web viewer."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from dextron_bench.leaderboard.highlights import FOLDER
from dextron_bench.leaderboard.page import FILE

LOOPBACK = "127.0.0.1"
NAMES = LOOPBACK, "localhost"  # Accepted host names; any other name belongs to another site (DNS rebinding).
RECORDING = re.compile(rf"/{FOLDER}/([A-Za-z0-9][A-Za-z0-9._+-]*\.rrd)")
LINK = re.compile(rf'href="\.\./{FOLDER}/([A-Za-z0-9._+%-]+\.rrd)"')
VIEWER = "/viewer/"
TABLES = {"table.csv": "text/csv; charset=utf-8", "table.json": "application/json"}
# Allows the viewer only its own files and the recordings of this server.
VIEWER_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' data: blob:; frame-ancestors 'none'"
)
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-cache",
}


class NoPage(LookupError):
    """The leaderboard's folder has no page."""


@dataclass(frozen=True, slots=True)
class Response:
    """A body with its MIME type and further headers."""

    mime_type: str
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Site:
    """The content to serve: a leaderboard's folder, and the viewer's files by name as (MIME type, body)."""

    board: Path
    viewer: dict[str, tuple[str, bytes]] = field(default_factory=dict)

    def respond(self, path: str, host: str) -> Response | None:
        """The response for a path if the server is addressed as `host`; None if the path does not exist."""
        if path in ("/", f"/{FILE}"):
            return Response("text/html; charset=utf-8", self._page(host).encode())
        if path[1:] in TABLES:
            return _file(self.board, path[1:], TABLES[path[1:]])
        if match := RECORDING.fullmatch(path):
            return _file(self.board.resolve().parent / FOLDER, match[1], "application/octet-stream")
        name = path.removeprefix(VIEWER) or FILE
        if path.startswith(VIEWER) and name in self.viewer:
            return Response(*self.viewer[name], {"Content-Security-Policy": VIEWER_POLICY})
        return None

    def _page(self, host: str) -> str:
        """The page; its links to recordings open the viewer if there is one."""
        text = (self.board / FILE).read_text(encoding="utf-8")
        if not self.viewer:
            return text

        def viewer_link(link: re.Match[str]) -> str:
            return f'href="{VIEWER}?url={quote(f"http://{host}/{FOLDER}/{link[1]}", safe="")}"'

        return LINK.sub(viewer_link, text)


class Server(ThreadingHTTPServer):
    """Serves a site on this machine only."""

    daemon_threads = True

    def __init__(self, site: Site, port: int) -> None:
        """Listens at a port; 0 takes a free one. Raises NoPage, OSError."""
        if not (site.board / FILE).is_file():
            raise NoPage(f"{site.board} has no {FILE}; `dextron-bench leaderboard build --into {site.board}` builds it")
        self.site = site
        super().__init__((LOOPBACK, port), _Handler)

    @property
    def address(self) -> str:
        """The address for a browser."""
        return f"http://{LOOPBACK}:{self.server_port}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Says nothing of a client that has hung up; other errors are printed with their traceback."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD requests from the site, and all others with an error."""

    server: Server  # pyright: ignore[reportIncompatibleVariableOverride]
    server_version, sys_version = "dextron-bench", ""
    protocol_version = "HTTP/1.1"
    timeout = 60  # [s] after which an idle connection is closed.

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, with_body: bool) -> None:
        host = self.headers.get("Host", "")
        if host not in {f"{name}:{self.server.server_port}" for name in NAMES}:
            self.send_error(HTTPStatus.FORBIDDEN, "this server answers only requests from this machine")
            return
        response = self.server.site.respond(unquote(self.path.partition("?")[0]), host)
        if response is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.send_response(HTTPStatus.OK)
        size = str(len(response.body))
        headers = {"Content-Type": response.mime_type, "Content-Length": size, **HEADERS, **response.headers}
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if with_body:
            self.wfile.write(response.body)

    def log_message(self, format: str, *args: object) -> None:
        """Prints nothing: requests are not logged."""


def _file(folder: Path, name: str, mime_type: str) -> Response | None:
    """A file in a folder; None if it does not exist or is a symbolic link, which may lead out of the folder."""
    file = folder / name
    return Response(mime_type, file.read_bytes()) if file.is_file() and not file.is_symlink() else None
