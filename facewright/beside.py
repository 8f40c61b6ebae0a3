"""Work that goes on in a second process, beside what this one does.

Not in a thread: those of one Python share a lock that most of the work here holds, so that two took as long as one. And
not in a pool of processes: one that was tried stayed for ever where the first process was killed. This one reads its
work from a pipe, and ends with it, after what it is at.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from threadpoolctl import threadpool_limits

from facewright.memory import peak_memory_mb

# Its path is this process's, or a file in the folder that the user works in could stand for a module.
_START = "import sys; sys.path[:] = sys.argv[1:]; from facewright.beside import _main; _main()"
_GONE = OSError, EOFError, pickle.UnpicklingError  # what talking to a process that has ended comes to


class Beside:
    """A second process, which does one thing after the other, or none: what it would do is done here when it is asked
    for. Results are the same.

    jobs     cores to be used by both processes together; one means that there is no second process
    peak_mb  the most memory that the second process was seen to have taken
    """

    def __init__(self, jobs=1):
        self.peak_mb, self._process, self._ended = 0.0, None, False
        # Within another program there may be none to start, or the program itself would be started again.
        able = "python" in Path(sys.executable or "").name.lower() and not getattr(sys, "frozen", False)
        self._talking = ThreadPoolExecutor(1) if jobs > 1 and able else None

    def __enter__(self):
        return self

    def __exit__(self, *failure):
        self._ended = True
        if self._process is not None:
            self._process.kill()
        if self._talking is not None:
            self._talking.shutdown(cancel_futures=True)
        if self._process is not None:
            self._process.wait()
            for pipe in (self._process.stdin, self._process.stdout):
                with suppress(OSError):  # what was never sent cannot be flushed
                    pipe.close()

    def begin(self, work, *arguments):
        """Begin work(*arguments), a function that another process can import by name; returns a _Begun."""
        return _Begun(self, work, arguments, self._talking and self._talking.submit(self._answer, work, arguments))

    def _answer(self, work, arguments):
        """What _serve answers, once it does."""
        if self._process is None:
            command, pipe = [sys.executable, "-c", _START, *filter(None, sys.path)], subprocess.PIPE
            self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe)
        if self._ended:  # meanwhile
            self._process.kill()
        pickle.dump((work, arguments), self._process.stdin, pickle.HIGHEST_PROTOCOL)
        self._process.stdin.flush()
        return pickle.load(self._process.stdout)


class _Begun:
    """Work that goes on elsewhere, or is still to be done."""

    def __init__(self, beside, work, arguments, answer):
        self._beside, self._work, self._arguments, self._answer = beside, work, arguments, answer

    def result(self):
        """What the work gives, once it is done."""
        answer = None
        if self._answer is not None:
            with suppress(*_GONE):  # a process that the system has ended, for want of memory say, is done without
                answer = self._answer.result()
        if answer is None:
            return self._work(*self._arguments)
        result, failure, peak_mb = answer
        self._beside.peak_mb = max(self._beside.peak_mb, peak_mb)
        if failure is not None:
            raise failure
        return result


def _serve(source, sink):
    """Do what comes from the file source, and write into sink (result, exception or None, peak_memory_mb())."""
    with suppress(*_GONE):
        while True:
            work, arguments = pickle.load(source)
            result = failure = None
            try:
                # As in the first process; only what is loaded by now can be limited.
                with threadpool_limits(1, user_api="blas"):
                    result = work(*arguments)
            except Exception as error:
                failure = error
            pickle.dump((result, failure, peak_memory_mb()), sink, pickle.HIGHEST_PROTOCOL)
            sink.flush()


def _main():
    # Whoever interrupts the job means the first process, which sees to it that this one ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What a library prints must not come between the answers.
    sink = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    _serve(sys.stdin.buffer, sink)
