"""A folder belongs to one config: the first writer records it, and later writers must have the same."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from dextron_bench.errors import BadInput
from dextron_bench.storage import atomic, provenance, records, run_times
from dextron_bench.storage.run_folder import RunFolder

TRIES, PAUSE = 10, 0.1  # Looks at an empty config, and seconds between them; then it is damaged.
RUN_ADVICE = "remove it, or choose another folder with --runs"


def check(folder: Path, config: Mapping[str, Any]) -> None:
    """Raises BadInput if a folder holds a run of another config, DamagedFile if its config cannot be read."""
    _check(RunFolder(folder).config, config, "run", RUN_ADVICE)


def write_or_check(folder: Path, config: Mapping[str, Any], defaults: Mapping[str, Any] | None = None) -> None:
    """Writes config, provenance and begin of a run if there is no config yet; raises the same errors as `check`.

    `config` contains the hash of the physics. `defaults` belong to a method whose config has only the settings that
    differ from them. They are stored with it for readers, and never compared. Of several processes that write at the
    same time, one writes both files, and the others check.
    """
    run = RunFolder(folder)
    is_new = _create(run.config, {**config, "defaults": defaults} if defaults else config)
    _check(run.config, config, "run", RUN_ADVICE)
    if is_new:
        run_times.note_begin(run)
        atomic.write_json(run.provenance, provenance.collect(config["physics"]))
    elif not run.provenance.exists() and not run.episodes.exists():  # The writer of the config was killed, or is slow.
        with suppress(FileExistsError):
            atomic.create_json(run.provenance, provenance.collect(config["physics"]))


def write_or_check_file(file: Path, config: Mapping[str, Any], content: str, advice: str) -> None:
    """Writes a config to a file that does not exist yet; raises BadInput if the file holds another config.

    The message says that the folder holds another `content`, such as "search", names the entries that differ, and ends
    with `advice`.
    """
    _create(file, config)
    _check(file, config, content, advice)


def _create(file: Path, config: Mapping[str, Any]) -> bool:
    """Writes a config; False if there is one."""
    if not file.exists():
        with suppress(FileExistsError):
            atomic.create_json(file, config)
            return True
    return False


def _check(file: Path, config: Mapping[str, Any], content: str, advice: str) -> None:
    if not file.exists():
        return
    for _ in range(TRIES):  # Where the file system has no links, the file is empty at first.
        if file.stat().st_size:
            break
        time.sleep(PAUSE)
    stored, expected = records.read(file, dict[str, Any]), json.loads(atomic.json_text(config))
    if names := list(differences(stored, expected)):
        raise BadInput(f"{file.parent} holds another {content}: it differs in {' and '.join(names)}; {advice}")


def differences(stored: Mapping[str, Any], expected: Mapping[str, Any]) -> Iterator[str]:
    """Names of the entries of `expected` with another stored value; inner names of a mapping in brackets."""
    for name, value in expected.items():
        stored_value = stored.get(name)
        if stored_value == value:
            continue
        if isinstance(value, dict) and isinstance(stored_value, dict):
            inner = sorted(key for key in value | stored_value if value.get(key) != stored_value.get(key))
            yield f"{name} ({', '.join(inner)})"
        else:
            yield name
