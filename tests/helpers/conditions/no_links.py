"""A file system without hard links and symbolic links, such as exFAT."""

import errno
import os
from typing import Any


def _refusing(source: Any, target: Any, *_: object, **__: object) -> None:
    raise OSError(errno.EPERM, os.strerror(errno.EPERM), source, None, target)


os.link = os.symlink = _refusing
