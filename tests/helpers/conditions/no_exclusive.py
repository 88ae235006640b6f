"""A file system on which no process can make a file alone: O_EXCL answers EOPNOTSUPP, and there are no links."""

import errno
import os
from typing import Any

import no_links

_open = os.open
_links = no_links  # Imported for what it does.


def _refusing(path: Any, flags: int, *rest: Any, **named: Any) -> int:
    if flags & os.O_EXCL and str(path).endswith((".locked", ".plays", ".json")):
        raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP), path)
    return _open(path, flags, *rest, **named)


os.open = _refusing
