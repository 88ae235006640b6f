"""Reads the authors' public release of recorded reaches, and checks every file of it.

A release is their archive, a folder or a checkout. The reader opens only files that the manifest names, unpacks nothing
to disk, and accepts a file only if its SHA-256 is the published one.
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

from dextron_bench.errors import BadInput
from dextron_bench.reaches.reach import Reach
from dextron_bench.reaches.recorded import parsing
from dextron_bench.storage.progress import Progress, no_progress

SHIPPED = Path(__file__).parents[2] / "data" / "real-manifest.json"
MAX_FILE = 1_000_000  # [bytes] far above the largest recording (41 kB), and harmless in memory.
MAX_MEMBERS = 100_000  # Most members of an archive; the authors' whole repository has a few thousand.
MEMBER = re.compile(r"(?:[^/\\]+/)?(?:data/)?(extracts/(?:meta/)?\w+\.json)")

Reader = Callable[[str], bytes]


@dataclass(frozen=True, slots=True)
class Manifest:
    """The published files: the SHA-256 of each, by its name from `extracts/` on, and of the manifest itself."""

    files: dict[str, str]
    digest: str

    @classmethod
    def load(cls, file: Path | None = None) -> Manifest:
        """Reads a manifest, by default the shipped one."""
        text = (file or SHIPPED).read_bytes()
        return cls(json.loads(text)["files"], hashlib.sha256(text).hexdigest())

    @property
    def reaches(self) -> list[str]:
        """Names of the reaches, sorted, since random draws depend on their order."""
        return sorted(Path(file).stem for file in self.files if "/meta/" not in file)


def read(location: Path, manifest: Manifest, progress: Progress = no_progress) -> list[Reach]:
    """All reaches of the release at `location`, sorted by name, after a check of each file against the manifest.

    Calls `progress` with the numbers of reaches read and in all. Raises BadInput, and FileNotFoundError if
    `location` does not exist.
    """
    names, reaches = manifest.reaches, []
    with _open_reader(location, manifest) as reader:
        for name in names:
            files = f"extracts/{name}.json", f"extracts/meta/{name}_meta.json"
            try:
                contents = {file: reader(file) for file in files}
                reach = parsing.parse(name, *contents.values())
            except parsing.RecordingError as error:
                raise BadInput(str(error)) from error
            _verify_hashes(manifest, contents)
            reaches.append(reach)
            progress(len(reaches), len(names))
    return reaches


def _verify_hashes(manifest: Manifest, contents: dict[str, bytes]) -> None:
    for file, content in contents.items():
        if hashlib.sha256(content).hexdigest() != manifest.files[file]:
            raise BadInput(f"{file}: its SHA-256 is not the published one; download the release again")


@contextmanager
def _open_reader(location: Path, manifest: Manifest) -> Iterator[Reader]:
    """A function from a file's name to its content, while the release at `location` is open."""
    if location.is_dir():
        yield _folder_reader(location, manifest)
        return
    if not location.exists():
        raise FileNotFoundError(f"{location} does not exist")
    try:
        with zipfile.ZipFile(location) as archive:
            yield _zip_reader(archive, location, manifest)
    except zipfile.BadZipFile as error:
        raise BadInput(f"{location} is not a valid zip file: {error}") from error


def _folder_reader(folder: Path, manifest: Manifest) -> Reader:
    candidates = [folder / "data", folder, *sorted(folder.glob("dextron-*/data"))]
    if folder.resolve().name == "extracts":
        candidates.append(folder.resolve().parent)
    root = next((candidate for candidate in candidates if (candidate / "extracts" / "meta").is_dir()), None)
    if root is None:
        raise BadInput(f"{folder} has no data/extracts/meta; name the release's top folder, data or extracts")
    _check_complete({file for file in manifest.files if (root / file).is_file()}, folder, manifest)

    def reader(file: str) -> bytes:
        with open(root / file, "rb") as stream:
            return _size_checked(file, stream.read(MAX_FILE + 1))

    return reader


def _zip_reader(archive: zipfile.ZipFile, location: Path, manifest: Manifest) -> Reader:
    members: dict[str, zipfile.ZipInfo] = {}
    if len(archive.infolist()) > MAX_MEMBERS:
        raise BadInput(f"{location} has more than {MAX_MEMBERS} members; this is not the authors' release")
    for info in archive.infolist():
        match = MEMBER.fullmatch(info.filename)
        if match and match[1] in manifest.files:
            _check_member(match[1], info, members)
            members[match[1]] = info
    _check_complete(members.keys(), location, manifest)

    def reader(file: str) -> bytes:
        try:
            with archive.open(members[file]) as stream:
                return _size_checked(file, stream.read(MAX_FILE + 1))
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError, OSError) as error:
            raise BadInput(f"{file}: cannot be read from {location}: {error}") from error

    return reader


def _check_member(file: str, info: zipfile.ZipInfo, members: dict[str, zipfile.ZipInfo]) -> None:
    """Refuses duplicates, symbolic links, encrypted members and large ones; the release has none of these.

    Also refuses compression methods whose few bytes can fill the memory, whatever size they state.
    """
    if file in members:
        raise BadInput(f"{file}: the archive has it twice ({members[file].filename}, {info.filename})")
    if stat.S_ISLNK(info.external_attr >> 16):
        raise BadInput(f"{file}: is a symbolic link in the archive")
    if info.flag_bits & 1:
        raise BadInput(f"{file}: is encrypted in the archive")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise BadInput(f"{file}: uses a compression method whose output size cannot be limited")
    if info.file_size > MAX_FILE:
        raise BadInput(f"{file}: unpacks to {info.file_size} bytes; the limit is {MAX_FILE}")


def _size_checked(file: str, content: bytes) -> bytes:
    if len(content) > MAX_FILE:
        raise BadInput(f"{file}: has more than {MAX_FILE} bytes, the limit")
    return content


def _check_complete(files: Iterable[str], location: Path, manifest: Manifest) -> None:
    missing = sorted(manifest.files.keys() - set(files))
    if missing:
        raise BadInput(f"{location} lacks {len(missing)} of {len(manifest.files)} files, first {missing[0]}")
