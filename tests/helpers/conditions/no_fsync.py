"""A file system that writes nothing to the disk on request: `fsync` answers EINVAL, or what FSYNC_ERROR names."""

import errno
import os

_NUMBER = getattr(errno, os.environ.get("FSYNC_ERROR", "EINVAL"))


def _fsync(descriptor: int) -> None:
    raise OSError(_NUMBER, os.strerror(_NUMBER))


os.fsync = _fsync
