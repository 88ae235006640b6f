"""The site of `view --web`: recordings that open together in Rerun's web viewer."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from dextron_bench.web.local_server import (
    Request,
    Response,
    ViewerFiles,
    file_response,
    redirect,
    viewer_file,
    viewer_link,
)

RECORDING = re.compile(r"/recordings/([0-9]{1,9})\.rrd")


class ViewerSite:
    """Recordings, and the viewer that opens all of them."""

    def __init__(self, files: Sequence[Path], viewer: ViewerFiles) -> None:
        self._files, self._viewer = files, viewer

    def respond(self, request: Request) -> Response | None:
        """The way to the viewer, a recording, or a file of the viewer; None for any other path."""
        if request.path == "/":
            return redirect(viewer_link(request.host, *(f"/recordings/{n}.rrd" for n in range(len(self._files)))))
        if (match := RECORDING.fullmatch(request.path)) and int(match[1]) < len(self._files):
            return file_response(self._files[int(match[1])], "application/octet-stream")
        return viewer_file(self._viewer, request.path)
