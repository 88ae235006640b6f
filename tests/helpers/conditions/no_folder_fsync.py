"""A file system that writes no folder to the disk: `fsync` of a folder answers EINVAL, or what FSYNC_ERROR names.

Folders of a host that a virtual machine shares, old CIFS and some FUSE do this.
"""

import errno
import os
import stat

_fsync = os.fsync
_NUMBER = getattr(errno, os.environ.get("FSYNC_ERROR", "EINVAL"))


def _refusing(descriptor: int) -> None:
    if stat.S_ISDIR(os.fstat(descriptor).st_mode):
        raise OSError(_NUMBER, os.strerror(_NUMBER))
    _fsync(descriptor)


os.fsync = _refusing
