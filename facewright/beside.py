"""Work that goes on in a second process, beside what this one does.

Not in a thread: those of one Python share a lock that most of the work here holds, so that two took as long as one.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import BrokenExecutor
from contextlib import suppress

from loky import ProcessPoolExecutor
from threadpoolctl import threadpool_limits

from facewright.memory import peak_memory_mb


class Beside:
    """A second process, which does one thing after the other, or none: what it would do is done here when it is asked
    for. Results are the same.

    jobs  cores to be used by both processes together; one means that there is no second process
    """

    def __init__(self, jobs=1):
        self.jobs, self.peak_mb, self._pool = jobs, 0.0, None
        # A daemon may have no children, and without shared memory there is no way to talk to one.
        if jobs > 1 and not multiprocessing.current_process().daemon:
            with suppress(OSError):
                self._pool = ProcessPoolExecutor(1)

    def __enter__(self):
        return self

    def __exit__(self, *failure):
        if self._pool is not None:
            self._pool.shutdown(kill_workers=True)

    def begin(self, work, *arguments):
        """Begin work(*arguments), a function that another process can import by name; returns a _Begun."""
        future = None
        if self._pool is not None:
            with suppress(BrokenExecutor):
                future = self._pool.submit(_worked, work, arguments)
        return _Begun(self, work, arguments, future)


class _Begun:
    """Work that goes on elsewhere, or is still to be done."""

    def __init__(self, beside, work, arguments, future):
        self._beside, self._work, self._arguments, self._future = beside, work, arguments, future

    def result(self):
        """What the work gives, once it is done."""
        if self._future is not None:
            # A process that the system has ended, for want of memory say, is done without.
            with suppress(BrokenExecutor):
                result, peak_mb = self._future.result()
                self._beside.peak_mb = max(self._beside.peak_mb, peak_mb)
                return result
        return self._work(*self._arguments)


def _worked(work, arguments):
    with threadpool_limits(1, user_api="blas"):  # as in the first process
        return work(*arguments), peak_memory_mb()
