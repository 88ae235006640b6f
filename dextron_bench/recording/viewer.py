"""Opens recordings in Rerun's viewer, on a screen or as screenshots without one."""

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

from dextron_bench.errors import Failed
from dextron_bench.processes import programs

LOOPBACK = "127.0.0.1"
HEADLESS = "--headless"  # A viewer without a window.
START_TIMEOUT = 180.0  # [s] in which a viewer must start.
NOTICE_TIME = 8.0  # [s] after which the viewer no longer shows its notices.
DRAW_TIME = 1.5  # [s] in which the viewer draws a new step.


class ViewerError(Failed):
    """Rerun's viewer cannot run."""


def require_screen() -> None:
    """Raises ViewerError on Linux without a display."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ViewerError(
            "there is no screen for the native viewer; `view --web` and `browse --web` open recordings in the browser"
        )


def view(files: Sequence[Path]) -> None:
    """Opens recordings in the native viewer and waits until the user closes it. Only this machine can reach it.

    Raises ViewerError, and FileNotFoundError if a recording does not exist.
    """
    _require(files)
    with viewer_process(["--port", "auto", *map(str, files)]) as process:
        wait(process)


def wait(process: subprocess.Popen[bytes]) -> None:
    """Waits until the user closes a viewer; raises ViewerError if it ends with an error."""
    if process.wait():
        raise ViewerError(f"Rerun's viewer ended with code {process.returncode}; does this machine have a screen?")


def screenshots(file: Path, pictures: Mapping[int, Path], width: int = 1600, height: int = 900) -> None:
    """Saves screenshots of a recording in the viewer, without a screen; `pictures` maps control steps to PNG files.

    Needs a Vulkan driver (Debian: apt install mesa-vulkan-drivers). Raises ViewerError, FileNotFoundError.
    """
    _require([file])
    port = free_port()
    window = [HEADLESS, "--window-size", f"{width}x{height}", "--hide-welcome-screen", "--port", str(port)]
    with TemporaryFile() as logs, viewer_process(window, logs) as process:
        try:
            client = ViewerClient.connect(address(port, process))
            client.open(str(file.resolve()))
            time.sleep(NOTICE_TIME)
            for step, picture in pictures.items():
                picture.parent.mkdir(parents=True, exist_ok=True)
                client.set_time("step", sequence=step)
                time.sleep(DRAW_TIME)
                client.save_screenshot(str(picture.resolve()))
        except Exception as error:  # The client raises errors of any type.
            logs.seek(0)
            last_line = logs.read().decode(errors="replace").strip().splitlines()[-1:]
            raise ViewerError(f"no screenshot of {file}: {error} {' '.join(last_line)}") from error


def _require(files: Sequence[Path]) -> None:
    for file in files:
        if not file.is_file():
            raise FileNotFoundError(f"there is no recording {file}")


@contextmanager
def viewer_process(arguments: Sequence[str], logs: IO[bytes] | None = None) -> Iterator[subprocess.Popen[bytes]]:
    """Runs a viewer process; the end of the block ends it and its children.

    Raises ViewerError if it would open a window where there is no screen.
    """
    if logs is None and HEADLESS not in arguments:
        require_screen()
    command = programs.python("-m", "rerun", "--bind", LOOPBACK, *arguments)
    environment = {"WGPU_BACKEND": "vulkan", **os.environ} if logs else None
    process = subprocess.Popen(command, env=environment, stdout=logs, stderr=logs, start_new_session=True)
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def address(port: int, process: subprocess.Popen[bytes]) -> str:
    """The address of a viewer, as soon as it accepts connections; raises ViewerError if it does not start."""
    deadline = time.monotonic() + START_TIMEOUT
    while time.monotonic() < deadline and process.poll() is None:
        try:
            socket.create_connection((LOOPBACK, port), timeout=1).close()
        except OSError:
            time.sleep(0.2)
        else:
            return f"rerun+http://{LOOPBACK}:{port}/proxy"
    raise ViewerError("Rerun's viewer did not start; does this machine have a screen?")


def free_port() -> int:
    """A free port of this machine."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
