"""What runs on a node: one task, in an empty folder, with its inputs and with its number of threads."""

from __future__ import annotations

import getpass
import os
import pickle
import platform
import shutil
import sys
import tempfile
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from dextron_bench.cluster import installation
from dextron_bench.cluster.tasks import CACHE, RUNS, OtherVersion, Reply, ResultFile, Task, content_hash
from dextron_bench.storage import atomic, hashing

THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS")
COMPUTED = "cache"  # Folder in the folder of runs.
DATA_FOLDER = "DEXTRON_CACHE"  # Names the folder of imported data.


def perform(expected: Mapping[str, str | None], pickled: bytes, places: Mapping[str, str], *contents: bytes) -> Reply:
    """Does a pickled task if this installation is the expected version.

    `places` are the places of inputs with their SHA-256, and `contents` their bytes, in the same order. Errors of the
    work become a reply too, so that no error is lost which cannot be pickled.
    """
    node = platform.node()
    try:
        installation.check(expected, node)
        task: Task = pickle.loads(pickled)
        with tempfile.TemporaryDirectory(prefix="dextron-task-") as folder:
            return Reply(node, tuple(_perform(task, Path(folder), places, contents)))
    except OtherVersion as error:
        return Reply(node, error=str(error), is_refusal=True)
    except Exception as error:
        text = str(error.args[0] if isinstance(error, KeyError) and error.args else error)
        name = "" if type(error).__module__.startswith("dextron_bench") else f"{type(error).__name__}: "
        return Reply(node, error=name + text, traceback=traceback.format_exc())


def _perform(task: Task, folder: Path, places: Mapping[str, str], contents: Sequence[bytes]) -> Iterator[ResultFile]:
    """Does a task in a folder; yields its files, except inputs that did not change."""
    runs = folder / RUNS
    runs.mkdir()
    _link_computed(runs)
    for (place, sha256), content in zip(places.items(), contents, strict=True):
        _copy(_stored(sha256, content), folder / place)
    _pin_threads(task.threads)
    with _data_folder(folder / CACHE):
        files = task.perform(runs, task.threads)
    for file in files:
        content, path = file.read_bytes(), file.relative_to(runs).as_posix()
        if (sha256 := content_hash(content)) != places.get(f"{RUNS}/{path}"):
            yield ResultFile(path, sha256, content)


def _node_folder() -> Path:
    """A folder of this node for what its tasks share."""
    user = os.getuid() if hasattr(os, "getuid") else getpass.getuser()  # In a container, a user may have no name.
    folder = Path(tempfile.gettempdir()) / f"dextron-bench-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def _stored(sha256: str, content: bytes) -> Path:
    """The file with a content, written once on each node."""
    file = _node_folder() / sha256
    if not file.exists() or hashing.sha256(file) != sha256:
        atomic.write_atomically(file, lambda part: part.write_bytes(content))
    return file


def _copy(stored: Path, place: Path) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(stored, place)


def _link_computed(runs: Path) -> None:
    """Lets tasks of one version on a node share what methods store in `cache`, such as expert episodes."""
    shared = _node_folder() / f"computed-{installation.version()['code']}"
    shared.mkdir(exist_ok=True)
    with suppress(OSError):  # Without symbolic links, each task computes it.
        (runs / COMPUTED).symlink_to(shared)


def _pin_threads(count: int) -> None:
    """Sets the numbers of threads of libraries, also where an earlier task of this process has set others."""
    import threadpoolctl

    for name in THREAD_VARIABLES:
        os.environ[name] = str(count)  # For libraries that are loaded later.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    threadpoolctl.threadpool_limits({"blas": 1, "openmp": count})
    if torch := sys.modules.get("torch"):
        torch.set_num_threads(count)


@contextmanager
def _data_folder(folder: Path) -> Iterator[None]:
    """Imported data is read from a folder, if the task has any as input; otherwise from the node's cache."""
    before = os.environ.get(DATA_FOLDER)
    if folder.exists():
        os.environ[DATA_FOLDER] = str(folder)
    try:
        yield
    finally:
        os.environ.pop(DATA_FOLDER, None)
        if before is not None:
            os.environ[DATA_FOLDER] = before
