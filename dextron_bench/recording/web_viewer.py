"""Takes the files of Rerun's web viewer from the installed package, so that any server can serve them offline."""

from __future__ import annotations

from http.client import HTTPConnection, HTTPException
from tempfile import TemporaryFile

from dextron_bench.recording.viewer import LOOPBACK, ViewerError, address, free_port, viewer_process

MIME_TYPES = {  # Of all files that the viewer requests, by name.
    "index.html": "text/html; charset=utf-8",
    "re_viewer.js": "text/javascript",
    "re_viewer_bg.wasm": "application/wasm",
    "sw.js": "text/javascript",
    "favicon.ico": "image/x-icon",
}


def web_viewer_files() -> dict[str, tuple[str, bytes]]:
    """The files of the web viewer by name, each with its MIME type and content; about 43 MB.

    Rerun's own server runs for the second that this takes, and only this machine can reach it. Raises ViewerError.
    """
    port, control = free_port(), free_port()
    arguments = ["--serve-web", "--web-viewer-port", str(port), "--port", str(control)]
    with TemporaryFile() as logs, viewer_process(arguments, logs) as process:
        address(port, process)
        try:
            return {name: (mime_type, _get(port, name)) for name, mime_type in MIME_TYPES.items()}
        except (OSError, HTTPException) as error:
            raise ViewerError(f"Rerun's web viewer cannot be read: {error}") from error


def _get(port: int, name: str) -> bytes:
    connection = HTTPConnection(LOOPBACK, port, timeout=30)
    try:
        connection.request("GET", f"/{name}")
        response = connection.getresponse()
        if response.status != 200:
            raise ViewerError(f"Rerun's web viewer has no {name}; is another version of rerun-sdk installed?")
        return response.read()
    finally:
        connection.close()
