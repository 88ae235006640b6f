"""The files of Rerun's web viewer, taken from the installed one, so that any server can offer them offline."""

from __future__ import annotations

from http.client import HTTPConnection, HTTPException
from tempfile import TemporaryFile

from dextron_bench.recording.viewer import LOOPBACK, ViewerError, address, free_port, viewer_process

KINDS = {  # By name; the viewer asks for nothing else.
    "index.html": "text/html; charset=utf-8",
    "re_viewer.js": "text/javascript",
    "re_viewer_bg.wasm": "application/wasm",
    "sw.js": "text/javascript",
    "favicon.ico": "image/x-icon",
}


def web_viewer_files() -> dict[str, tuple[str, bytes]]:
    """The web viewer's files by name, each with its kind (MIME type), about 43 MB; takes a second.

    Rerun's own server, which keeps a core busy, runs for that long only and on this machine alone. Raises ViewerError.
    """
    port, control = free_port(), free_port()
    words = ["--serve-web", "--web-viewer-port", str(port), "--port", str(control)]
    with TemporaryFile() as logs, viewer_process(words, logs) as opened:
        address(port, opened)
        try:
            return {name: (kind, _get(port, name)) for name, kind in KINDS.items()}
        except (OSError, HTTPException) as error:
            raise ViewerError(f"Rerun's web viewer could not be read: {error}") from error


def _get(port: int, name: str) -> bytes:
    connection = HTTPConnection(LOOPBACK, port, timeout=30)
    try:
        connection.request("GET", f"/{name}")
        answer = connection.getresponse()
        if answer.status != 200:
            raise ViewerError(f"Rerun's web viewer has no {name}; is another version of rerun-sdk installed?")
        return answer.read()
    finally:
        connection.close()
