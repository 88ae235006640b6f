"""A file system without modes and times that a user can set, such as FAT of another owner: EPERM."""

import errno
import os
from typing import Any


def _refusing(path: Any, *_: object, **__: object) -> None:
    raise OSError(errno.EPERM, os.strerror(errno.EPERM), path)


os.chmod = os.utime = _refusing
