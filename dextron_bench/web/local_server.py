"""Serves a site on this machine only: pages, files, and forms that the pages send."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Protocol, runtime_checkable
from urllib.parse import parse_qsl, quote, unquote

from dextron_bench.errors import Failed

LOOPBACK = "127.0.0.1"
NAMES = LOOPBACK, "localhost"  # Accepted host names; any other name belongs to another site (DNS rebinding).
VIEWER = "/viewer/"
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
LARGEST_FORM = 10_000  # [bytes]

ViewerFiles = Mapping[str, tuple[str, bytes]]  # MIME type and content of each file of the web viewer, by name.


@dataclass(frozen=True, slots=True)
class Request:
    """A request: path without query, the query, and the host name and port that it names."""

    path: str
    query: Mapping[str, str]
    host: str


@dataclass(frozen=True, slots=True)
class Response:
    """A body with its MIME type, status and further headers."""

    mime_type: str
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)
    status: HTTPStatus = HTTPStatus.OK


class Site(Protocol):
    """The content of a server."""

    def respond(self, request: Request) -> Response | None:
        """The response to a request that changes nothing; None if the path does not exist."""
        ...


@runtime_checkable
class FormSite(Site, Protocol):
    """A site that also takes forms."""

    def submit(self, request: Request, form: Mapping[str, str]) -> Response | None:
        """The response to a form; None if it is not one of this site's forms."""
        ...


class NoPort(Failed):
    """A port at which this process cannot listen."""

    def __init__(self, port: int, why: str) -> None:
        super().__init__(f"port {port}: {why}; choose another with --port, or --port 0 for a free one")


class LocalServer(ThreadingHTTPServer):
    """Serves a site on this machine only."""

    daemon_threads = True

    def __init__(self, site: Site, port: int) -> None:
        """Listens at a port; 0 takes a free one. Raises NoPort."""
        self.site = site
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise NoPort(port, error.strerror or str(error)) from error

    @property
    def address(self) -> str:
        """The address for a browser."""
        return f"http://{LOOPBACK}:{self.server_port}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Says nothing of a client that has hung up; other errors are printed with their traceback."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers requests from the site, and all that it does not have with an error."""

    server: LocalServer  # pyright: ignore[reportIncompatibleVariableOverride]
    server_version, sys_version = "dextron-bench", ""
    protocol_version = "HTTP/1.1"
    timeout = 60  # [s] after which an idle connection is closed.

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def do_POST(self) -> None:
        self.close_connection = True  # A refused form is not read.
        site = self.server.site
        if not isinstance(site, FormSite):
            self.send_error(HTTPStatus.NOT_IMPLEMENTED)
        elif (request := self._request()) is not None:
            length = self.headers.get("Content-Length", "")
            if not length.isdecimal() or int(length) > LARGEST_FORM:
                self.send_error(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
                return
            form = dict(parse_qsl(self.rfile.read(int(length)).decode(errors="replace")))
            self._send(site.submit(request, form), with_body=True)

    def _answer(self, with_body: bool) -> None:
        if (request := self._request()) is not None:
            self._send(self.server.site.respond(request), with_body)

    def _request(self) -> Request | None:
        """The request; None if it was refused because it does not come from this machine."""
        host = self.headers.get("Host", "")
        if host not in {f"{name}:{self.server.server_port}" for name in NAMES}:
            self.send_error(HTTPStatus.FORBIDDEN, "this server answers only requests from this machine")
            return None
        if self.headers.get("Sec-Fetch-Site") == "cross-site" and self.headers.get("Sec-Fetch-Mode") != "navigate":
            self.send_error(HTTPStatus.FORBIDDEN, "this server answers only its own pages")
            return None
        path, _, query = self.path.partition("?")
        return Request(unquote(path), dict(parse_qsl(query)), host)

    def _send(self, response: Response | None, with_body: bool) -> None:
        if response is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.send_response(response.status)
        size = str(len(response.body))
        headers = {"Content-Type": response.mime_type, "Content-Length": size, **HEADERS, **response.headers}
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        if with_body:
            self.wfile.write(response.body)

    def log_message(self, format: str, *args: object) -> None:
        """Prints nothing: requests are not logged."""


def viewer_file(viewer: ViewerFiles, path: str) -> Response | None:
    """A file of the web viewer below VIEWER; None if the path is no such file."""
    name = path.removeprefix(VIEWER) or "index.html"
    if not path.startswith(VIEWER) or name not in viewer:
        return None
    return Response(*viewer[name], {"Content-Security-Policy": VIEWER_POLICY})


def viewer_link(host: str, *paths: str) -> str:
    """The address of recordings of this server, whose paths are quoted, in the web viewer."""
    recordings = "&".join("url=" + quote(f"http://{host}{path}", safe="") for path in paths)
    return f"{VIEWER}?{recordings}"


def redirect(address: str) -> Response:
    """Sends the browser to another address of this server."""
    return Response("text/plain", b"", {"Location": address}, HTTPStatus.SEE_OTHER)


def file_response(file: Path, mime_type: str) -> Response | None:
    """A file; None if it does not exist or is a symbolic link, which may lead out of its folder."""
    return Response(mime_type, file.read_bytes()) if file.is_file() and not file.is_symlink() else None
