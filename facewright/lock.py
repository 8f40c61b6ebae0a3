"""A lock for one run at a time. It belongs to the process: one that is killed leaves none behind."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_HELD = PermissionError if sys.platform == "win32" else BlockingIOError
FAR = 1 << 20  # Windows forbids to read what is locked: a byte past the end leaves the process id readable


class Locked(Exception):
    """Somebody else holds the lock; owner: the id of that process, as text."""

    def __init__(self, owner):
        super().__init__(f"held by process {owner}")
        self.owner = owner


@contextmanager
def locked(path):
    """Hold the lock on a file, made if needed, that tells who has it; raises Locked. The file stays, the lock ends.

    A file system that knows no locks (some network folders) is trusted.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT)
    try:
        _lock(descriptor)
        os.ftruncate(descriptor, 0)
        os.write(descriptor, str(os.getpid()).encode())
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor):
    try:
        if sys.platform == "win32":
            os.lseek(descriptor, FAR, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except _HELD:
        os.lseek(descriptor, 0, os.SEEK_SET)
        raise Locked(os.read(descriptor, 20).decode() or "unknown") from None
    except OSError:
        pass
    os.lseek(descriptor, 0, os.SEEK_SET)
