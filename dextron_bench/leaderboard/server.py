"""Serves the leaderboard's page on this machine only, with recordings in Rerun's web viewer."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from dextron_bench.leaderboard.collect import RESULTS
from dextron_bench.leaderboard.highlights import FOLDER
from dextron_bench.leaderboard.page import FILE
from dextron_bench.submissions.bundle import AGENT
from dextron_bench.web.local_server import (
    LocalServer,
    Request,
    Response,
    file_response,
    viewer_file,
    viewer_link,
)

RECORDING = re.compile(rf"/{FOLDER}/([A-Za-z0-9][A-Za-z0-9._+-]*\.rrd)")
LINK = re.compile(rf'href="\.\./{FOLDER}/([A-Za-z0-9._+%-]+\.rrd)"')
CODE = re.compile(rf"/{RESULTS}/([A-Za-z0-9][\w.+-]*)/([a-z]+)/{AGENT}/([A-Za-z0-9][\w.+-]*)", re.ASCII)
TABLES = {"table.csv": "text/csv; charset=utf-8", "table.json": "application/json"}


class NoPage(LookupError):
    """The leaderboard's folder has no page."""


@dataclass(frozen=True, slots=True)
class Site:
    """The content to serve: a leaderboard's folder, and the viewer's files by name as (MIME type, body)."""

    board: Path
    viewer: dict[str, tuple[str, bytes]] = field(default_factory=dict)

    def respond(self, request: Request) -> Response | None:
        """The response to a request; None if its path does not exist."""
        path = request.path
        if path in ("/", f"/{FILE}"):
            return Response("text/html; charset=utf-8", self._page(request.host).encode())
        if path[1:] in TABLES:
            return file_response(self.board / path[1:], TABLES[path[1:]])
        if match := RECORDING.fullmatch(path):
            return file_response(self.board.resolve().parent / FOLDER / match[1], "application/octet-stream")
        if match := CODE.fullmatch(path):
            # Text, so that no browser runs what a stranger wrote.
            file = self.board / RESULTS / match[1] / match[2] / AGENT / match[3]
            return file_response(file, "text/plain" if file.suffix == ".py" else "application/octet-stream")
        return viewer_file(self.viewer, path)

    def _page(self, host: str) -> str:
        """The page; its links to recordings open the viewer if there is one."""
        text = (self.board / FILE).read_text(encoding="utf-8")
        if not self.viewer:
            return text
        return LINK.sub(lambda link: f'href="{viewer_link(host, f"/{FOLDER}/{link[1]}")}"', text)


class Server(LocalServer):
    """Serves a leaderboard on this machine only."""

    site: Site

    def __init__(self, site: Site, port: int) -> None:
        """Listens at a port; 0 takes a free one. Raises NoPage, NoPort."""
        if not (site.board / FILE).is_file():
            raise NoPage(
                f"{site.board} has no {FILE}; `dextron-bench leaderboard build --board {site.board}` builds it"
            )
        super().__init__(site, port)
