"""The site of `browse`: the page, its pictures, and recordings that are made when they are opened."""

from __future__ import annotations

import re
import secrets
from collections.abc import Callable, Mapping
from http import HTTPStatus
from pathlib import Path
from threading import Lock
from typing import cast

import pandas as pd

from dextron_bench.catalogue import episodes as catalogue
from dextron_bench.catalogue import rerecording, selection
from dextron_bench.catalogue.browse import page
from dextron_bench.catalogue.browse.pictures import Pictures
from dextron_bench.catalogue.browse.search import Search
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.web.local_server import (
    Request,
    Response,
    ViewerFiles,
    file_response,
    redirect,
    viewer_file,
    viewer_link,
)

KEY = r"([0-9a-f]{16})"
PICTURE, OPEN = re.compile(rf"/picture/{KEY}\.png"), re.compile(rf"/open/{KEY}")
RECORDING = re.compile(rf"/recordings/{KEY}\.rrd")

Show = Callable[[Path], None]  # Shows a recording, and does not wait until the user has seen it.


class DamagedRecording(ValueError):
    """A recording that is not shown."""


class BrowseSite:
    """The episodes of a catalogue. Recordings open with `show`, or in the web viewer if its files are given."""

    def __init__(self, episodes: pd.DataFrame, show: Show | None = None, viewer: ViewerFiles | None = None) -> None:
        self._episodes, self._show, self._viewer = episodes, show, viewer or {}
        self._token = secrets.token_urlsafe()  # Other sites do not know it, so that they cannot send forms.
        self._pictures, self._lock = Pictures(), Lock()

    def respond(self, request: Request) -> Response | None:
        """The page, a picture, a recording, or a file of the viewer; None for any other path."""
        if request.path == "/":
            return self._page(Search.of(request.query))
        if match := PICTURE.fullmatch(request.path):
            return self._picture(match[1])
        if (match := RECORDING.fullmatch(request.path)) and match[1] in self._episodes.index:
            return file_response(self._file(match[1]), "application/octet-stream")
        return viewer_file(self._viewer, request.path)

    def submit(self, request: Request, form: Mapping[str, str]) -> Response | None:
        """Opens the recording of an episode; makes it first if needed."""
        match = OPEN.fullmatch(request.path)
        if match is None or match[1] not in self._episodes.index:
            return None
        if not secrets.compare_digest(form.get("token", "").encode(), self._token.encode()):
            return Response(
                "text/plain",
                b"this form is not of this server's page; load the page again\n",
                status=HTTPStatus.FORBIDDEN,
            )
        key, search = match[1], Search.of(form)
        try:
            with self._lock:
                self._make(key)
            if self._show is not None:
                self._show(self._file(key))
        except Exception as error:  # The page shows it, and goes on.
            return self._page(search, " ".join(str(error).split()) or type(error).__name__)
        here = f"{search.address}#e{key}"
        return redirect(viewer_link(request.host, f"/recordings/{key}.rrd") if self._show is None else here)

    def close(self) -> None:
        """Ends what runs beside the server."""
        self._pictures.close()

    def _page(self, search: Search, problem: str = "") -> Response:
        target = "in the browser" if self._show is None else "in the viewer"
        notice = problem or (f"There are no pictures: {self._pictures.problem}" if self._pictures.problem else "")
        text = page.document(self._episodes, search, self._token, target, notice)
        return Response("text/html; charset=utf-8", text.encode(), {"Content-Security-Policy": page.POLICY})

    def _picture(self, key: str) -> Response | None:
        if key not in self._episodes.index:
            return None
        state = catalogue.last_state(self._episode(key))
        content = None if state is None else self._pictures.draw(key, state)
        return None if content is None else Response("image/png", content, {"Cache-Control": "private, max-age=3600"})

    def _episode(self, key: str) -> pd.Series:
        return cast(pd.Series, self._episodes.loc[key])

    def _file(self, key: str) -> Path:
        episode = self._episode(key)
        return RunFolder(Path(episode["run"])).recording(episode["split"], episode["row"])

    def _make(self, key: str) -> None:
        """Makes the recording of an episode if there is none; raises the errors of `rerecord`, and DamagedRecording."""
        from dextron_bench import recording

        files = rerecording.rerecord(self._episodes.loc[[key]])
        for summary in recording.summarise(files, whole=True, hashes=selection.hashes(files)):
            if summary.damage:
                raise DamagedRecording(f"{summary.file}: {summary.damage}")
