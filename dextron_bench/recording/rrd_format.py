"""What the first and the last bytes of an .rrd file say: whether it is one, the version that wrote it, its end."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

MAGIC, FOOT = b"RRF2", b"FOOT"  # An .rrd file starts with MAGIC and has FOOT before its last four bytes.
HEAD, TAIL = 12, 8  # [bytes] sizes of an .rrd file's header, and of its end from FOOT on.
FOOTERS_SINCE = (0, 28)  # The first version of Rerun that writes FOOT.
INSTALLED = ".".join(version("rerun-sdk").split(".")[:2])


@dataclass(frozen=True, slots=True)
class RrdFormat:
    """The version of Rerun that wrote a file, if it is an .rrd file, and its fault in words, empty if there is none."""

    version: tuple[int, ...] = ()
    fault: str = ""

    @property
    def writer(self) -> str:
        """The version in words, such as "Rerun 0.26.2"."""
        return f"Rerun {'.'.join(map(str, self.version))}"

    @property
    def is_current(self) -> bool:
        """True if the installed version of Rerun wrote the file, but for the last part of its number."""
        return ".".join(map(str, self.version[:2])) == INSTALLED

    @property
    def has_footer(self) -> bool:
        """True if this version ends its files with a footer; without one, a file is only read from start to end."""
        return self.version >= FOOTERS_SINCE

    def undecodable(self, reason: str) -> str:
        """Why the file, which has no other fault, cannot be decoded: it is damaged, or of another version of Rerun."""
        if self.is_current:
            return f"is damaged ({reason})"
        return f"was written by {self.writer}, and Rerun {INSTALLED} cannot read it ({reason})"


def look_at(file: Path) -> RrdFormat:
    """The format of a file, from its first and its last bytes."""
    if not file.is_file():
        return RrdFormat(fault="is no file" if file.exists() else "there is no such file")
    try:
        with file.open("rb") as stream:
            head = stream.read(HEAD)
            stream.seek(-min(len(head), TAIL), os.SEEK_END)
            tail = stream.read()
    except OSError as error:
        return RrdFormat(fault=f"cannot be read ({error.strerror})")
    if not head:
        return RrdFormat(fault="is empty")
    if head[:3] != MAGIC[:3][: len(head)]:
        return RrdFormat(fault="is no .rrd file")
    return _of_bytes(head, tail)


def _of_bytes(head: bytes, tail: bytes) -> RrdFormat:
    """The format that the header and the end of an .rrd file state."""
    if len(head) < HEAD:
        return RrdFormat(fault="is cut short: it has no whole header")
    written = RrdFormat(tuple(head[4:7]))
    if head[:4] != MAGIC:
        return replace(written, fault=f"is an .rrd file of another version of Rerun ({written.writer} wrote it)")
    if written.has_footer and tail[:4] != FOOT:
        return replace(written, fault="is cut short: it has no footer")
    return written
