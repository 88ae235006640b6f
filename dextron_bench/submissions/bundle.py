"""Bundles: a zip with everything that a submission claims and the hashes of its files.

A bundle may come from a stranger, so reading one checks names, kinds, sizes and hashes.
"""

from __future__ import annotations

import ast
import hashlib
import json
import re
import stat
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

from msgspec import to_builtins
from msgspec.structs import replace

from dextron_bench.errors import BadInput
from dextron_bench.processes import limited_process
from dextron_bench.storage import atomic, hashing, records
from dextron_bench.storage.folders import visible
from dextron_bench.storage.printable import first_hidden
from dextron_bench.storage.run_folder import RunFolder
from dextron_bench.submissions.manifest import ClaimedResult, Manifest

T = TypeVar("T", Manifest, ClaimedResult)
KINDS: dict[type[Manifest] | type[ClaimedResult], str] = {Manifest: "bundle", ClaimedResult: "result"}
MOST_SEEDS = 10
MANIFEST = "bundle.json"
AGENT = "agent"  # The folder of the agent's own files.
JSON_PROCESS = "dextron_bench.submissions.json_process"
MEMBER = re.compile(
    r"bundle\.json|agent/[A-Za-z0-9][\w.+-]*\.(?:py|pt|onnx|safetensors)"
    r"|seed\d{1,6}/(?:config\.json|provenance\.json|result\.json|recordings\.json|episodes\.parquet"
    r"|recordings/[a-z-]+-\d{4}\.rrd)",
    re.ASCII,
)
MEMBERS = 20_000  # The largest number of files.
LARGEST_DIRECTORY = 4 * 2**20  # [bytes] of the list of files in a zip.
LARGEST = 256 * 2**20  # [bytes] of one unpacked file.
LARGEST_JSON = 4 * 2**20  # [bytes] of a JSON file.
MEMORY, SECONDS = 2 * limited_process.GIBIBYTE, 30.0  # [bytes], [s] of the process that checks a JSON file.
TOTAL = 8 * 2**30  # [bytes] of all unpacked files.
END, END_SIZE, ZIP64 = b"PK\5\6", 22, b"PK\6\7"  # The record at the end of a zip file; before it, one of large files.
LARGEST_COMMENT = 2**16  # [bytes] after the end record.
CHUNK = 2**20  # [bytes] that are copied at once.
MEMBER_DATE = (1980, 1, 1, 0, 0, 0)  # The same for every member, so that equal contents make equal bundles.


class BadBundle(BadInput):
    """A file that is not a complete bundle, or files that differ from its manifest."""


def pack(folder: Path, manifest: Manifest, agent: Mapping[str, Path], file: Path) -> Manifest:
    """Writes the runs `seed<k>` in a folder and an agent's own files, by name, as a bundle.

    Returns its manifest: the given one (see `Entry.manifest`) with the hashes of the files.
    """
    run_files = [path for seed in manifest.seeds for path in visible(RunFolder.of_seed(folder, seed).path, "**/*")]
    members = {name: path for path in run_files if MEMBER.fullmatch(name := str(path.relative_to(folder)))}
    check_agent(agent)
    members |= {f"{AGENT}/{name}": path for name, path in agent.items()}
    manifest = replace(manifest, files={name: hashing.sha256(path) for name, path in members.items()})
    check(to_builtins(manifest), Manifest, file)

    def write(part: Path) -> None:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
            text = atomic.json_text(manifest, indent=1) + "\n"
            archive.writestr(_info(MANIFEST), text)
            for name, path in members.items():
                with archive.open(_info(name), "w") as output, path.open("rb") as content:
                    while block := content.read(CHUNK):
                        output.write(block)

    atomic.write_atomically(file, write)
    return manifest


def unpack(file: Path, into: Path) -> Manifest:
    """Unpacks a bundle into an empty folder and returns its manifest; raises BadBundle, OSError.

    Writes nothing outside the folder. Checks names, sizes and hashes before it parses the content of any file.
    """
    if file.exists() and not file.is_file():  # Opening a pipe would wait for whoever writes into it.
        raise BadBundle(f"{file} is not a regular file")
    try:
        _check_directory(file)
        with zipfile.ZipFile(file) as archive:
            members = _members(file, archive)
            manifest = parse(_content(file, archive, members.get(MANIFEST)), Manifest, file)
            _check_files(file, set(members) - {MANIFEST}, set(manifest.files))
            for name, sha256 in manifest.files.items():
                if _extract(file, archive, members[name], into / name) != sha256:
                    raise BadBundle(f"{file}: {name} has another SHA-256 than the manifest lists")
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, UnicodeError) as error:
        raise BadBundle(
            f"{file} is not a complete zip file ({error}); make the bundle again with `dextron-bench submit`"
        ) from error
    return manifest


def parse(content: bytes, kind: type[T], file: Path) -> T:
    """What a JSON file of a stranger holds, after a separate process has checked it; raises BadBundle."""
    name = KINDS[kind]
    if len(content) > LARGEST_JSON:
        raise BadBundle(f"{file}: the {name} is larger than {LARGEST_JSON / 2**20:g} MiB")
    done = limited_process.run(JSON_PROCESS, [name, str(file)], content, MEMORY, SECONDS)
    if done.code == 1 and done.output:
        raise BadBundle(ast.literal_eval(done.output.decode()))
    if done.code != 0:
        raise BadBundle(f"{file}: the {name} cannot be checked (the process that read it {done.ending})")
    return records.convert(json.loads(content), kind)


def check(value: Any, kind: type[Manifest] | type[ClaimedResult], file: Path) -> None:
    """Raises BadBundle if a JSON value is not of a kind, or holds text that cannot be printed."""
    name = KINDS[kind]
    try:
        json.dumps(value, ensure_ascii=False, allow_nan=False).encode()
    except ValueError as error:
        raise BadBundle(f"{file}: the {name} has invalid text or numbers ({error})") from error
    for text in _texts(value):
        if character := first_hidden(text):
            raise BadBundle(f"{file}: the {name} has invalid text: it has the character {character!r}")
    try:
        content = records.convert(value, kind)
    except records.Mismatch as error:
        message = error.why if len(error.why) < 200 else f"{error.why[:200]}..."
        raise BadBundle(f"{file}: {error.place or 'an entry'} in the {name} is invalid: {message}") from None
    if isinstance(content, Manifest) and len(content.seeds) > MOST_SEEDS:
        raise BadBundle(f"{file} has {len(content.seeds)} seeds; a submission has at most {MOST_SEEDS}")


def _texts(value: Any) -> Iterator[str]:
    """Every text in a JSON value, names of entries too."""
    if isinstance(value, str):
        yield value
    for part in chain(value, value.values()) if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _texts(part)


def check_agent(files: Mapping[str, Path]) -> None:
    """Raises BadBundle if a bundle cannot hold an agent's own files, given by name."""
    for name, file in files.items():
        _check_name(file, f"{AGENT}/{name}")
        if file.stat().st_size > LARGEST:
            raise BadBundle(f"{file} is larger than the {LARGEST / 2**20:.0f} MiB that a bundle accepts")


def _check_directory(file: Path) -> None:
    """Raises BadBundle if the list of members, which is read as a whole, is too long or lies outside the file."""
    with file.open("rb") as content:
        start = content.seek(max(0, file.stat().st_size - END_SIZE - LARGEST_COMMENT - len(ZIP64) - 16))
        tail = content.read()
    last = len(tail) - END_SIZE  # Where `zipfile` looks first; then it takes the last record before a comment.
    place = last if tail[last:].startswith(END) and tail.endswith(b"\0\0") else tail.rfind(END)
    size, offset = (int.from_bytes(tail[place + k : place + k + 4], "little") if place >= 0 else 0 for k in (12, 16))
    if size > LARGEST_DIRECTORY or tail[max(0, place - 20) :].startswith(ZIP64):
        raise BadBundle(f"{file} lists more files than the {MEMBERS} that a bundle accepts")
    if place >= 0 and offset + size > start + place:  # `zipfile` would look for files before the first byte.
        raise BadBundle(f"{file} is not a complete zip file: its list of files is not where its end says")


def _members(file: Path, archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """The members by name; raises BadBundle for members that a bundle never holds."""
    members: dict[str, zipfile.ZipInfo] = {}
    infos = archive.infolist()
    if len(infos) > MEMBERS or sum(info.file_size for info in infos) > TOTAL:
        raise BadBundle(f"{file} would unpack to more than {MEMBERS} files or {TOTAL / 2**30:g} GiB")
    for info in infos:
        _check_name(file, info.filename)
        if info.filename in members:
            raise BadBundle(f"{file} holds {info.filename} twice")
        if stat.S_ISLNK(info.external_attr >> 16) or info.flag_bits & 1:
            raise BadBundle(f"{file}: {info.filename} is a link or encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BadBundle(f"{file}: {info.filename} uses a compression method whose output size cannot be limited")
        if info.file_size > (LARGEST_JSON if info.filename.endswith(".json") else LARGEST):
            raise BadBundle(f"{file}: {info.filename} is too large when unpacked ({info.file_size / 2**20:.0f} MiB)")
        members[info.filename] = info
    return members


def _check_name(file: Path, name: str) -> None:
    if not MEMBER.fullmatch(name):
        raise BadBundle(f"{file}: a bundle cannot hold a file {name!r}")


def _check_files(file: Path, present: set[str], listed: set[str]) -> None:
    if missing := sorted(listed - present):
        raise BadBundle(f"{file} lacks {missing[0]}, which its manifest lists")
    if extra := sorted(present - listed):
        raise BadBundle(f"{file} holds {extra[0]}, which its manifest does not list")


def _content(file: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo | None) -> bytes:
    if info is None:
        raise BadBundle(f"{file} is not a bundle: it lacks {MANIFEST}; `dextron-bench submit` makes one")
    with archive.open(info) as member:
        content = member.read(LARGEST_JSON + 1)
    if len(content) > LARGEST_JSON:
        raise BadBundle(f"{file}: {info.filename} unpacks to more bytes than it states")
    return content


def _extract(file: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, place: Path) -> str:
    """Writes a member to `place`, at most as many bytes as it states; returns its SHA-256."""
    place.parent.mkdir(parents=True, exist_ok=True)
    sha256, size = hashlib.sha256(), 0
    with archive.open(info) as content, place.open("wb") as output:
        while block := content.read(CHUNK):
            size += len(block)
            if size > info.file_size:
                raise BadBundle(f"{file}: {info.filename} unpacks to more bytes than it states")
            sha256.update(block)
            output.write(block)
    return sha256.hexdigest()


def _info(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, MEMBER_DATE)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    return info
