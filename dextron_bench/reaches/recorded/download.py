"""Downloading the authors' public release of recorded reaches."""

from __future__ import annotations

import tempfile
import urllib.error
import urllib.request
from http.client import HTTPException
from pathlib import Path
from typing import IO

from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded.cache import Progress, import_release
from dextron_bench.reaches.recorded.release import Manifest

RELEASE = "https://github.com/sharif1093/dextron/archive/a101b9e7e4b1ba3875c36eb555543b2bb7a79818.zip"
LIMIT = 1_000_000_000  # [bytes] the whole repository with its meshes is well below.
CHUNK = 1 << 18
TIMEOUT = 30.0  # [s] without a byte.


class FetchError(RuntimeError):
    """The release could not be downloaded; the message says why and what to do instead."""

    def __init__(self, url: str, reason: object) -> None:
        super().__init__(
            f"cannot download {url}: {reason}; download it where there is a network, "
            "then run `dextron-bench data import --from <zip>`"
        )


def fetch(manifest: Manifest | None = None, progress: Progress | None = None, url: str = RELEASE) -> list[Reach]:
    """Downloads the release, imports it as `archive.import_release` does, and returns its reaches.

    `progress` hears of (bytes, all bytes or 0 where unknown). Raises FetchError, ReleaseError, OSError.
    """
    with tempfile.TemporaryDirectory(prefix="dextron-bench-") as folder:
        file = Path(folder) / "release.zip"
        with file.open("wb") as target:
            download(url, target, progress=progress)
        return import_release(file, manifest)


def download(url: str, target: IO[bytes], limit: int = LIMIT, progress: Progress | None = None) -> None:
    """Copies what lies at `url` to `target`; raises FetchError, also beyond `limit` bytes."""
    try:
        with urllib.request.urlopen(url, timeout=TIMEOUT) as response:
            if url.startswith("https:") and not response.url.startswith("https:"):
                raise FetchError(url, "it leads to an address without encryption")
            announced = int(response.headers.get("Content-Length") or 0)
            _copy(url, response, target, limit, announced, progress)
    except urllib.error.HTTPError as error:
        raise FetchError(url, f"the server answers {error.code} {error.reason}") from error
    except urllib.error.URLError as error:
        raise FetchError(url, error.reason) from error
    except (HTTPException, TimeoutError, ConnectionError) as error:
        raise FetchError(url, f"the connection broke ({error or type(error).__name__})") from error


def _copy(
    url: str, response: IO[bytes], target: IO[bytes], limit: int, announced: int, progress: Progress | None
) -> None:
    done = 0
    while chunk := response.read(CHUNK):
        done += len(chunk)
        if done > limit or announced > limit:
            raise FetchError(url, f"it has more than {limit} bytes")
        target.write(chunk)
        if progress:
            progress(done, announced)
    if done < announced:
        raise FetchError(url, f"the connection broke after {done} of {announced} bytes")
