"""Recordings in Rerun's viewer, on a screen or, without one, as pictures."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from rerun.experimental import ViewerClient

LOOPBACK = "127.0.0.1"
PATIENCE = 60.0  # [s] to wait for a viewer to come up.
NOTICES = 8.0  # [s] after which the viewer's own notices have left the picture.
SETTLE = 1.5  # [s] after which a new step has been drawn.


class ViewerError(RuntimeError):
    """The viewer could not be run."""


def view(files: Sequence[Path]) -> None:
    """Opens recordings in the native viewer, reachable from this machine only, until it is closed.

    Raises ViewerError, and FileNotFoundError for a recording that is not there.
    """
    _all_there(files)
    with viewer_process(["--port", "auto", *map(str, files)]) as opened:
        wait(opened)


def wait(opened: subprocess.Popen[bytes]) -> None:
    """Waits until a viewer is closed; raises ViewerError where it ended otherwise."""
    if opened.wait():
        raise ViewerError(f"Rerun's viewer ended with code {opened.returncode}; does this machine have a screen?")


def screenshots(file: Path, pictures: Mapping[int, Path], width: int = 1600, height: int = 900) -> None:
    """Saves what the viewer shows of a recording, without a screen: control step to PNG file.

    Needs a Vulkan driver (Debian: apt install mesa-vulkan-drivers). Raises ViewerError, FileNotFoundError.
    """
    _all_there([file])
    port = free_port()
    window = ["--headless", "--window-size", f"{width}x{height}", "--hide-welcome-screen", "--port", str(port)]
    with TemporaryFile() as logs, viewer_process(window, logs) as opened:
        try:
            client = ViewerClient.connect(address(port, opened))
            client.open(str(file.resolve()))
            time.sleep(NOTICES)
            for step, picture in pictures.items():
                picture.parent.mkdir(parents=True, exist_ok=True)
                client.set_time("step", sequence=step)
                time.sleep(SETTLE)
                client.save_screenshot(str(picture.resolve()))
        except Exception as error:  # The client raises whatever its server says.
            logs.seek(0)
            said = logs.read().decode(errors="replace").strip().splitlines()[-1:]
            raise ViewerError(f"no screenshot of {file}: {error} {' '.join(said)}") from error


def _all_there(files: Sequence[Path]) -> None:
    for file in files:
        if not file.is_file():
            raise FileNotFoundError(f"there is no recording {file}")


@contextmanager
def viewer_process(arguments: Sequence[str], logs: IO[bytes] | None = None) -> Iterator[subprocess.Popen[bytes]]:
    """A viewer process, ended with all its children when the block is left."""
    command = [sys.executable, "-m", "rerun", "--bind", LOOPBACK, *arguments]
    environment = {"WGPU_BACKEND": "vulkan", **os.environ} if logs else None
    opened = subprocess.Popen(command, env=environment, stdout=logs, stderr=logs, start_new_session=True)
    try:
        yield opened
    finally:
        with suppress(ProcessLookupError):
            os.killpg(opened.pid, signal.SIGTERM)
        opened.wait()


def address(port: int, opened: subprocess.Popen[bytes]) -> str:
    """Where a viewer is reached, once it listens; raises ViewerError."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until and opened.poll() is None:
        try:
            socket.create_connection((LOOPBACK, port), timeout=1).close()
        except OSError:
            time.sleep(0.2)
        else:
            return f"rerun+http://{LOOPBACK}:{port}/proxy"
    raise ViewerError("Rerun's viewer did not come up; does this machine have a screen?")


def free_port() -> int:
    """A port that nobody listens at."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
