"""The authors' public release of recorded reaches: finding its files, checking them, reading them.

A release is their archive, a folder or a checkout. Only names of the manifest are ever looked for, nothing
is unpacked, and no file counts before its SHA-256 is the published one.
"""

from __future__ import annotations

import hashlib
import json
import re
import stat
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded import parsing

SHIPPED = Path(__file__).parents[2] / "data" / "real-manifest.json"
MAX_FILE = 1_000_000  # [bytes] far above the largest recording (41 kB), far below what hurts.
MAX_MEMBERS = 100_000  # Members of an archive; the authors' whole repository has a few thousand.
MEMBER = re.compile(r"(?:[^/\\]+/)?(?:data/)?(extracts/(?:meta/)?\w+\.json)")

Reader = Callable[[str], bytes]


class ReleaseError(ValueError):
    """A release that cannot be imported; the message names the file and says what is wrong with it."""


@dataclass(frozen=True, slots=True)
class Manifest:
    """What was published: SHA-256 of each file by its name from `extracts/` on, and of the list itself."""

    files: dict[str, str]
    digest: str

    @classmethod
    def load(cls, file: Path | None = None) -> Manifest:
        """Reads a manifest, by default the shipped one."""
        text = (file or SHIPPED).read_bytes()
        return cls(json.loads(text)["files"], hashlib.sha256(text).hexdigest())

    @property
    def reaches(self) -> list[str]:
        """Names of the reaches, sorted: draws depend on this order."""
        return sorted(Path(file).stem for file in self.files if "/meta/" not in file)


def read(where: Path, manifest: Manifest, progress: Callable[[int, int], None] | None = None) -> list[Reach]:
    """All reaches of the release at `where`, in sorted order, each file checked against the manifest.

    `progress` hears of (done, all). Raises ReleaseError, and FileNotFoundError where there is nothing.
    """
    names, reaches = manifest.reaches, []
    with _opened(where, manifest) as reader:
        for name in names:
            samples, notes = f"extracts/{name}.json", f"extracts/meta/{name}_meta.json"
            try:
                recording, marks = reader(samples), reader(notes)
                reach = parsing.parse(name, recording, marks)
            except parsing.RawError as error:
                raise ReleaseError(str(error)) from error
            _verify(manifest, {samples: recording, notes: marks})
            reaches.append(reach)
            if progress:
                progress(len(reaches), len(names))
    return reaches


def _verify(manifest: Manifest, files: dict[str, bytes]) -> None:
    for file, content in files.items():
        if hashlib.sha256(content).hexdigest() != manifest.files[file]:
            raise ReleaseError(f"{file}: its SHA-256 is not the published one; get the release again")


@contextmanager
def _opened(where: Path, manifest: Manifest) -> Iterator[Reader]:
    if where.is_dir():
        yield _folder(where, manifest)
        return
    if not where.exists():
        raise FileNotFoundError(f"{where} does not exist")
    try:
        with zipfile.ZipFile(where) as archive:
            yield _archive(archive, where, manifest)
    except zipfile.BadZipFile as error:
        raise ReleaseError(f"{where} is not a sound zip file: {error}") from error


def _folder(where: Path, manifest: Manifest) -> Reader:
    homes = [where / "data", where, *sorted(where.glob("dextron-*/data"))]
    if where.resolve().name == "extracts":
        homes.append(where.resolve().parent)
    home = next((home for home in homes if (home / "extracts" / "meta").is_dir()), None)
    if home is None:
        raise ReleaseError(f"{where} has no data/extracts/meta; name the release's top folder, data or extracts")
    _complete({file for file in manifest.files if (home / file).is_file()}, where, manifest)

    def reader(file: str) -> bytes:
        with open(home / file, "rb") as stream:
            return _limited(file, stream.read(MAX_FILE + 1))

    return reader


def _archive(archive: zipfile.ZipFile, where: Path, manifest: Manifest) -> Reader:
    members: dict[str, zipfile.ZipInfo] = {}
    if len(archive.infolist()) > MAX_MEMBERS:
        raise ReleaseError(f"{where} has more than {MAX_MEMBERS} members; this is not the authors' release")
    for info in archive.infolist():
        match = MEMBER.fullmatch(info.filename)
        if match and match[1] in manifest.files:
            _plain(match[1], info, members)
            members[match[1]] = info
    _complete(members.keys(), where, manifest)

    def reader(file: str) -> bytes:
        try:
            with archive.open(members[file]) as stream:
                return _limited(file, stream.read(MAX_FILE + 1))
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
            raise ReleaseError(f"{file}: cannot be read from {where}: {error}") from error

    return reader


def _plain(file: str, info: zipfile.ZipInfo, seen: dict[str, zipfile.ZipInfo]) -> None:
    """Refuses what a published file never is."""
    if file in seen:
        raise ReleaseError(f"{file}: the archive has it twice ({seen[file].filename}, {info.filename})")
    if stat.S_ISLNK(info.external_attr >> 16):
        raise ReleaseError(f"{file}: is a symbolic link in the archive")
    if info.flag_bits & 1:
        raise ReleaseError(f"{file}: is encrypted in the archive")
    if info.file_size > MAX_FILE:
        raise ReleaseError(f"{file}: unpacks to {info.file_size} bytes; none has more than {MAX_FILE}")


def _limited(file: str, content: bytes) -> bytes:
    if len(content) > MAX_FILE:
        raise ReleaseError(f"{file}: has more than {MAX_FILE} bytes; none of the release has")
    return content


def _complete(found: Iterable[str], where: Path, manifest: Manifest) -> None:
    missing = sorted(manifest.files.keys() - set(found))
    if missing:
        raise ReleaseError(f"{where} lacks {len(missing)} of {len(manifest.files)} files, first {missing[0]}")
