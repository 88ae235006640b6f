"""Downloads the authors' public release of recorded reaches."""

from __future__ import annotations

import tempfile
import urllib.error
import urllib.request
from http.client import HTTPException
from pathlib import Path
from typing import IO

from dextron_bench.errors import Failed
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded.cache import cache_file, import_release
from dextron_bench.reaches.recorded.release import Manifest
from dextron_bench.storage.progress import Progress, no_progress

RELEASE = "https://github.com/sharif1093/dextron/archive/a101b9e7e4b1ba3875c36eb555543b2bb7a79818.zip"
LIMIT = 1_000_000_000  # [bytes] well above the size of the whole repository with its meshes.
CHUNK = 1 << 18
TIMEOUT = 30.0  # [s] longest wait for the next bytes.


class FetchError(Failed):
    """The release could not be downloaded; the message says why and what to do instead."""

    def __init__(self, url: str, reason: object) -> None:
        super().__init__(
            f"cannot download {url}: {reason}; download it on a machine with a network connection, "
            "then run `dextron-bench data import --from <zip>`"
        )


def fetch(manifest: Manifest | None = None, progress: Progress = no_progress, url: str = RELEASE) -> list[Reach]:
    """Downloads the release, imports it as `cache.import_release` does, and returns its reaches.

    Calls `progress` with the number of bytes so far, and the total or 0 if the server does not report it. Raises
    FetchError, BadInput, NoHome or OSError.
    """
    cache_file()  # Without a place for the reaches, nothing is downloaded.
    with tempfile.TemporaryDirectory(prefix="dextron-bench-") as folder:
        file = Path(folder) / "release.zip"
        with file.open("wb") as target:
            download(url, target, progress=progress)
        return import_release(file, manifest)


def download(url: str, target: IO[bytes], limit: int = LIMIT, progress: Progress = no_progress) -> None:
    """Copies the content at `url` to `target`. Raises FetchError, also if it has more than `limit` bytes."""
    try:
        with urllib.request.urlopen(url, timeout=TIMEOUT) as response:
            if url.startswith("https:") and not response.url.startswith("https:"):
                raise FetchError(url, "it redirects to an address without encryption")
            expected = int(response.headers.get("Content-Length") or 0)
            _copy(url, response, target, limit, expected, progress)
    except urllib.error.HTTPError as error:
        raise FetchError(url, f"the server answers {error.code} {error.reason}") from error
    except urllib.error.URLError as error:
        raise FetchError(url, error.reason) from error
    except (HTTPException, TimeoutError, ConnectionError) as error:
        raise FetchError(url, f"the connection broke ({error or type(error).__name__})") from error


def _copy(url: str, response: IO[bytes], target: IO[bytes], limit: int, expected: int, progress: Progress) -> None:
    done = 0
    while chunk := response.read(CHUNK):
        done += len(chunk)
        if done > limit or expected > limit:
            raise FetchError(url, f"it has more than {limit} bytes")
        target.write(chunk)
        progress(done, expected)
    if done < expected:
        raise FetchError(url, f"the connection broke after {done} of {expected} bytes")
