"""A file system without locks: `flock` answers ENOSYS, or the error that FLOCK_ERROR names, such as ENOLCK."""

import errno
import fcntl
import os

_NUMBER = getattr(errno, os.environ.get("FLOCK_ERROR", "ENOSYS"))


def _flock(file: object, operation: int) -> None:
    raise OSError(_NUMBER, os.strerror(_NUMBER))


fcntl.flock = _flock
