"""The one lock for processes, on one machine or on many: a file that only one of them can make.

The file says who made it, and goes when its holder ends well. A process that finds the file of a holder that was killed
takes it over, if the end of the holder is certain:

- Where the file system has `flock`, the holder also locks the file in this way, and the system ends that with the
  process, whatever container or machine it is on.
- Elsewhere, number and start of a process prove it, if the machine has not started anew and the container is the same.

Without certainty the file stays, and the message says when to remove it.
"""

from __future__ import annotations

import functools
import json
import os
import platform
import secrets
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

from dextron_bench.errors import Failed
from dextron_bench.storage import atomic

try:
    import fcntl
except ImportError:  # On Windows.
    fcntl = None

LONGEST = 4096  # [bytes] of a lock file that are read.
Say = Callable[[str], None]  # Shows a text to processes that look at the lock.


@dataclass(frozen=True, slots=True)
class Holder:
    """The process that holds a lock. What the system does not say is an empty text."""

    host: str
    process: int
    since: str
    boot: str  # Differs after each start of the machine, and is the same in all of its containers.
    numbering: str  # Of processes: each container has its own.
    start: str  # Of the process, in ticks since the start of the machine; its number may be used again.
    has_flock: bool
    token: str

    def __str__(self) -> str:
        return f"process {self.process} on {self.host}, since {self.since}"


class Held(Failed):
    """A lock that another process holds; the message says who, and when its file may be removed."""

    def __init__(self, file: Path, holder: Holder | None, is_certain: bool) -> None:
        self.is_certain = is_certain
        holds = str(holder) if holder else "it does not say by whom"
        remedy = "" if is_certain else "; if that process has ended, remove the lock file"
        super().__init__(f"lock file {file}: {holds}{remedy}")


@contextmanager
def held(file: Path) -> Iterator[Say]:
    """Holds a lock while the block lasts; raises Held if another process holds it.

    Yields what shows a text to others (`text`). Where no file can be made by one process alone, a line on stderr says
    so, and the block goes on.
    """
    with ExitStack() as kept:
        with atomic.naming(file):
            holder, content = _take(file, kept)
        try:
            yield functools.partial(_say, file)
        finally:
            with suppress(OSError):  # Somebody may have removed it.
                if _is_of(holder, file, content):
                    file.unlink()


def _take(file: Path, kept: ExitStack) -> tuple[Holder, BinaryIO]:
    """Makes the file of a lock, which stays open for `flock`; returns its holder and the open file. Raises Held."""
    part = atomic.temporary(file)
    atomic.remove_abandoned(file, part)
    try:
        content = kept.enter_context(part.open("wb"))
        holder = _this_process(has_flock=_flock(content.fileno(), exclusive=True) is True)
        content.write(json.dumps(asdict(holder)).encode() + b"\n")
        content.flush()
        if not holder.has_flock:
            content.close()  # Windows removes no open file.
        _make(part, file)
    finally:
        part.unlink(missing_ok=True)
    return holder, content


def _say(file: Path, shown: str) -> None:
    """Writes a text into a lock file, after the line of its holder."""
    with suppress(OSError), file.open("r+b") as content:  # A full disk stops nothing here.
        content.seek(len(content.readline()))
        content.write(shown.encode())
        content.truncate()


def _is_of(holder: Holder, file: Path, content: BinaryIO) -> bool:
    """True if a lock file is still this holder's."""
    if holder.has_flock:
        return os.path.samestat(os.fstat(content.fileno()), file.stat())  # Some shares let nobody read a locked file.
    return _read(file)[0] == holder


def is_held(file: Path) -> bool:
    """True if a process holds a lock, or may hold it."""
    try:
        return _is_alive(file, _read(file)[0]) is not False
    except FileNotFoundError:
        return False


def text(file: Path) -> str | None:
    """What the holder of a lock shows; None if nobody holds it."""
    try:
        holder, shown = _read(file)
        return None if _is_alive(file, holder) is False else shown
    except FileNotFoundError:
        return None


def _make(part: Path, file: Path) -> None:
    """Gives a complete file the name of the lock; raises Held."""
    while True:
        try:
            return atomic.put_new(part, file)
        except FileExistsError:
            _remove_if_ended(file)
        except OSError as error:
            if error.errno not in atomic.LACKING:
                raise
            return _warn(error.strerror)


@functools.cache
def _warn(reason: str) -> None:
    """Says once that there are no locks."""
    text = f"this file system has no locks ({reason}): let no other process work in the same folder"
    print(f"dextron-bench: {text}", file=sys.stderr)


def _remove_if_ended(file: Path) -> None:
    """Removes the file of a holder that has ended; raises Held.

    Of several processes that have seen the same ended holder, the lock of its token lets one remove the file, which is
    still this holder's then.
    """
    try:
        holder, _ = _read(file)
        alive = _is_alive(file, holder)
        if holder is None or alive is not False:
            raise Held(file, holder, is_certain=alive is True)
        try:
            with held(file.with_name(f"{file.name}-{holder.token}")):
                if _read(file)[0] == holder:
                    file.unlink()
        except Held as other:
            raise Held(file, holder, other.is_certain) from None
    except FileNotFoundError:
        return


def _read(file: Path) -> tuple[Holder | None, str]:
    """The holder, None if the file does not say, and the text that it shows; raises FileNotFoundError."""
    try:
        with file.open("rb") as content:
            line, _, shown = content.read(LONGEST).partition(b"\n")
        return Holder(**json.loads(line)), shown.decode(errors="replace")
    except FileNotFoundError:
        raise
    except (OSError, ValueError, TypeError):
        return None, ""


def _is_alive(file: Path, holder: Holder | None) -> bool | None:
    """True or False if it is certain that a holder lives, or that it has ended; raises FileNotFoundError."""
    if holder is None or holder.has_flock:
        with file.open("rb") as content:
            is_free = _flock(content.fileno(), exclusive=False)
        if is_free is not None and (holder or not is_free):
            return not is_free
    here = _this_process()
    if holder is None or not holder.boot or (holder.boot, holder.numbering) != (here.boot, here.numbering):
        return None
    if (start := _start(str(holder.process))) is not None:
        return start == holder.start
    try:
        os.kill(holder.process, 0)  # Where a system names a boot, this only asks; Windows would end the process.
    except ProcessLookupError:
        return False
    except OSError:  # The process of another user, which the system hides.
        return None
    return None


def _flock(descriptor: int, exclusive: bool) -> bool | None:
    """True if the system locks a file for this process, False if another one has locked it, None if it has no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_NB | (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH))
    except BlockingIOError:
        return False
    except OSError:  # ENOSYS, EOPNOTSUPP, ENOLCK, and more: each file system has its own.
        return None
    return True


def _this_process(has_flock: bool = False) -> Holder:
    """This process as a holder."""
    return Holder(
        host=platform.node() or "an unknown host",
        process=int(_system(lambda: os.readlink("/proc/self")) or os.getpid()),
        since=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        boot=_system(Path("/proc/sys/kernel/random/boot_id").read_text).strip(),
        numbering=_system(lambda: os.readlink("/proc/self/ns/pid")),
        start=_start("self") or "",
        has_flock=has_flock,
        token=secrets.token_hex(8),
    )


def _start(process: str) -> str | None:
    """When a process began; empty if it has ended and its parent does not know yet, None if the system does not say it.

    The system hides processes of others where /proc is mounted so.
    """
    words = _system(Path(f"/proc/{process}/stat").read_text).rpartition(")")[2].split()
    if len(words) < 20:
        return None
    return "" if words[0] in ("Z", "X") else words[19]


def _system(read: Callable[[], str]) -> str:
    """What the system says; empty where it does not."""
    try:
        return read()
    except (OSError, ValueError):
        return ""
