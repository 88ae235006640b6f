"""A file system whose files cannot be mapped into memory, such as some FUSE: ENODEV."""

import errno
import mmap
import os


class _Refusing(mmap.mmap):
    def __new__(cls, descriptor: int, *_: object, **__: object) -> "_Refusing":
        raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))


mmap.mmap = _Refusing
