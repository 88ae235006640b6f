"""The leaderboard's page over HTTP, for this machine alone, its recordings opened in Rerun's web viewer."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote, unquote

from dextron_bench.leaderboard.highlights import FOLDER
from dextron_bench.leaderboard.page import FILE

LOOPBACK = "127.0.0.1"
NAMES = LOOPBACK, "localhost"  # What a browser may call this machine; any other name is another site's (DNS rebinding).
RECORDING = re.compile(rf"/{FOLDER}/([A-Za-z0-9][A-Za-z0-9._+-]*\.rrd)")
LINK = re.compile(rf'href="\.\./{FOLDER}/([A-Za-z0-9._+%-]+\.rrd)"')
VIEWER = "/viewer/"
TABLES = {"table.csv": "text/csv; charset=utf-8", "table.json": "application/json"}
# Of the viewer: its own files and this server's recordings, so that it reaches nothing else.
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
    """A leaderboard's folder without its page."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A body with its kind (MIME type) and further headers."""

    kind: str
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Site:
    """What is served: a leaderboard's folder, and the viewer's files by name with their kinds, once there are any."""

    board: Path
    viewer: dict[str, tuple[str, bytes]] = field(default_factory=dict)

    def answer(self, path: str, host: str) -> Answer | None:
        """What lies at a path, for whom reaches this server as `host`; None where nothing does."""
        if path in ("/", f"/{FILE}"):
            return Answer("text/html; charset=utf-8", self._page(host).encode())
        if path[1:] in TABLES:
            return _file(self.board, path[1:], TABLES[path[1:]])
        if found := RECORDING.fullmatch(path):
            return _file(self.board.resolve().parent / FOLDER, found[1], "application/octet-stream")
        name = path.removeprefix(VIEWER) or FILE
        if path.startswith(VIEWER) and name in self.viewer:
            return Answer(*self.viewer[name], {"Content-Security-Policy": VIEWER_POLICY})
        return None

    def _page(self, host: str) -> str:
        """The page, with links to recordings that open the viewer where there is one."""
        text = (self.board / FILE).read_text(encoding="utf-8")
        if not self.viewer:
            return text

        def opened(link: re.Match[str]) -> str:
            return f'href="{VIEWER}?url={quote(f"http://{host}/{FOLDER}/{link[1]}", safe="")}"'

        return LINK.sub(opened, text)


class Server(ThreadingHTTPServer):
    """Offers a site to this machine alone."""

    daemon_threads = True

    def __init__(self, site: Site, port: int) -> None:
        """Listens at a port, 0 for a free one. Raises NoPage, OSError."""
        if not (site.board / FILE).is_file():
            raise NoPage(f"{site.board} has no {FILE}; `dextron-bench leaderboard build --into {site.board}` makes it")
        self.site = site
        super().__init__((LOOPBACK, port), _Handler)

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        return f"http://{LOOPBACK}:{self.server_port}/"


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD with what the site has, and everything else with an error."""

    server: Server  # pyright: ignore[reportIncompatibleVariableOverride]
    server_version, sys_version = "dextron-bench", ""
    protocol_version = "HTTP/1.1"
    timeout = 60  # [s] after which a silent connection is closed.

    def do_GET(self) -> None:
        self._answer(with_body=True)

    def do_HEAD(self) -> None:
        self._answer(with_body=False)

    def _answer(self, with_body: bool) -> None:
        host = self.headers.get("Host", "")
        if host not in {f"{name}:{self.server.server_port}" for name in NAMES}:
            self.send_error(HTTPStatus.FORBIDDEN, "only this machine is served")
            return
        found = self.server.site.answer(unquote(self.path.partition("?")[0]), host)
        if found is None:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.send_response(HTTPStatus.OK)
        told = {"Content-Type": found.kind, "Content-Length": str(len(found.body)), **HEADERS, **found.headers}
        for name, value in told.items():
            self.send_header(name, value)
        self.end_headers()
        if with_body:
            self.wfile.write(found.body)

    def log_message(self, format: str, *args: object) -> None:
        """Requests are not told."""


def _file(folder: Path, name: str, kind: str) -> Answer | None:
    """A file of a folder; none where it is not there, or is a link to elsewhere."""
    file = folder / name
    return Answer(kind, file.read_bytes()) if file.is_file() and not file.is_symlink() else None
