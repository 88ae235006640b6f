"""Bundles: one zip with everything that a submission claims and the hashes of its files; from strangers."""

from __future__ import annotations

import hashlib
import json
import re
import stat
import zipfile
import zlib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
from jsonschema.exceptions import best_match

from dextron_bench.storage import atomic, hashing
from dextron_bench.storage.run_folder import RunFolder

FORMAT = 1
MANIFEST = "bundle.json"
MEMBER = re.compile(
    r"bundle\.json|agent/[A-Za-z0-9][\w.+-]*\.(?:py|pt|onnx|safetensors)"
    r"|seed\d{1,6}/(?:config\.json|provenance\.json|result\.json|recordings\.json|episodes\.parquet"
    r"|recordings/[a-z-]+-\d{4}\.rrd)",
    re.ASCII,
)
MEMBERS = 20_000
LARGEST = 256 * 2**20  # [bytes] of one file, unpacked.
MANIFESTS = 4 * 2**20  # [bytes] of the manifest.
TOTAL = 8 * 2**30  # [bytes] of all files, unpacked.
CHUNK = 2**20
MOMENT = (1980, 1, 1, 0, 0, 0)  # What every member is dated, so that equal contents make equal bundles.


class BadBundle(ValueError):
    """A file that is no whole bundle, or claims what is not so."""


def pack(folder: Path, told: Mapping[str, Any], agent: Mapping[str, Path], file: Path) -> dict[str, Any]:
    """Writes the runs `seed<k>` in a folder and an agent's own files, by name, as a bundle; returns its manifest."""
    found = [file for seed in told["seeds"] for file in sorted(RunFolder.of_seed(folder, seed).path.rglob("*"))]
    parts = {name: file for file in found if MEMBER.fullmatch(name := str(file.relative_to(folder)))}
    check_agent(agent)
    parts |= {f"agent/{name}": found for name, found in agent.items()}
    hashes = {name: hashing.sha256(found) for name, found in parts.items()}
    manifest = {"format": FORMAT, **told, "files": hashes}
    check(manifest, "bundle", file)

    def write(part: Path) -> None:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
            text = json.dumps(manifest, indent=1, sort_keys=True) + "\n"
            archive.writestr(_info(MANIFEST), text)
            for name, found in parts.items():
                with archive.open(_info(name), "w") as to, found.open("rb") as content:
                    while block := content.read(CHUNK):
                        to.write(block)

    atomic.write_atomically(file, write)
    return manifest


def unpack(file: Path, into: Path) -> dict[str, Any]:
    """Unpacks a bundle into an empty folder; returns its manifest. Writes nothing outside; raises BadBundle, OSError.

    Names, sizes and hashes are checked before anything in the files is looked at.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            members = _members(file, archive)
            manifest = _manifest(file, _content(file, archive, members.get(MANIFEST)))
            _check_files(file, set(members) - {MANIFEST}, set(manifest["files"]))
            for name, wanted in manifest["files"].items():
                if _extract(file, archive, members[name], into / name) != wanted:
                    raise BadBundle(f"{file}: {name} is not the file whose SHA-256 the manifest has")
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, UnicodeError) as error:
        raise BadBundle(
            f"{file} is no whole zip file ({error}); make the bundle again with `dextron-bench submit`"
        ) from error
    return manifest


def check(value: Any, schema: str, file: Path) -> None:
    """Raises BadBundle where a JSON value is not as a shipped schema says, or holds text that cannot be written."""
    try:
        json.dumps(value, ensure_ascii=False, allow_nan=False).encode()
    except ValueError as error:
        raise BadBundle(f"{file}: the {schema} has text or numbers that are none ({error})") from error
    error = best_match(_schema(schema).iter_errors(value))
    if error:
        where = "/".join(map(str, error.absolute_path)) or "it"
        message = error.message if len(error.message) < 200 else f"{error.message[:200]}..."
        raise BadBundle(f"{file}: {where} in the {schema} is not as it should be: {message}")


def check_agent(files: Mapping[str, Path]) -> None:
    """Raises BadBundle where no bundle could hold an agent's own files, by name."""
    for name, file in files.items():
        _check_name(file, f"agent/{name}")
        if file.stat().st_size > LARGEST:
            raise BadBundle(f"{file} is larger than the {LARGEST / 2**20:.0f} MiB that a bundle takes")


@cache
def _schema(name: str) -> jsonschema.Draft202012Validator:
    text = files("dextron_bench.data").joinpath(f"{name}.schema.json").read_text(encoding="utf-8")
    return jsonschema.Draft202012Validator(json.loads(text))


def _members(file: Path, archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """The members by name; raises BadBundle for what a bundle never holds."""
    found: dict[str, zipfile.ZipInfo] = {}
    infos = archive.infolist()
    if len(infos) > MEMBERS or sum(info.file_size for info in infos) > TOTAL:
        raise BadBundle(f"{file} would unpack to more than {MEMBERS} files or {TOTAL / 2**30:g} GiB")
    for info in infos:
        _check_name(file, info.filename)
        if info.filename in found:
            raise BadBundle(f"{file} holds {info.filename} twice")
        if stat.S_ISLNK(info.external_attr >> 16) or info.flag_bits & 1:
            raise BadBundle(f"{file}: {info.filename} is a link or encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BadBundle(f"{file}: {info.filename} is packed in a way of which sizes cannot be held to")
        if info.file_size > (MANIFESTS if info.filename == MANIFEST else LARGEST):
            raise BadBundle(f"{file}: {info.filename} would unpack to too much ({info.file_size / 2**20:.0f} MiB)")
        found[info.filename] = info
    return found


def _check_name(file: Path, name: str) -> None:
    if not MEMBER.fullmatch(name):
        raise BadBundle(f"{file}: a bundle has no file {name!r}")


def _check_files(file: Path, there: set[str], told: set[str]) -> None:
    if missing := sorted(told - there):
        raise BadBundle(f"{file} lacks {missing[0]}, which its manifest has")
    if extra := sorted(there - told):
        raise BadBundle(f"{file} holds {extra[0]}, which its manifest has not")


def _manifest(file: Path, content: bytes) -> dict[str, Any]:
    try:
        found = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise BadBundle(f"{file}: {MANIFEST} is no JSON ({error})") from error
    check(found, "bundle", file)
    return found


def _content(file: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo | None) -> bytes:
    if info is None:
        raise BadBundle(f"{file} is no bundle: it lacks {MANIFEST}; `dextron-bench submit` makes one")
    with archive.open(info) as content:
        found = content.read(MANIFESTS + 1)
    if len(found) > MANIFESTS:
        raise BadBundle(f"{file}: {info.filename} unpacks to more than it says")
    return found


def _extract(file: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, place: Path) -> str:
    """Writes a member to its place, no more than it says; returns its SHA-256."""
    place.parent.mkdir(parents=True, exist_ok=True)
    total, size = hashlib.sha256(), 0
    with archive.open(info) as content, place.open("wb") as to:
        while block := content.read(CHUNK):
            size += len(block)
            if size > info.file_size:
                raise BadBundle(f"{file}: {info.filename} unpacks to more than it says")
            total.update(block)
            to.write(block)
    return total.hexdigest()


def _info(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, MOMENT)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    return info
