import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from facewright.beside import Beside
from facewright.errors import InputError
from facewright.template.store import find_template


@pytest.mark.parametrize("jobs", [1, 2])
def test_work_is_done_wherever_it_is_done(jobs):
    values = np.arange(1000.0)
    with Beside(jobs) as beside:
        begun = [beside.begin(np.sum, values[:count]) for count in (10, 1000)]
        assert [work.result() for work in begun] == [45.0, 499500.0]
        assert (beside.begin(os.getpid).result() == os.getpid()) == (jobs == 1)
        assert (beside.peak_mb > 10) == (jobs == 2)


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_goes_wrong_is_told_as_it_was(jobs, tmp_path):
    with Beside(jobs) as beside:
        with pytest.raises(InputError, match="nobody"):
            beside.begin(find_template, tmp_path / "nobody").result()
        with pytest.raises(FileNotFoundError):
            beside.begin(os.stat, tmp_path / "nothing").result()
        assert beside.begin(np.sum, np.ones(3)).result() == 3.0


def test_it_takes_modules_from_where_the_first_process_does(tmp_path, monkeypatch):
    (tmp_path / "threadpoolctl.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    with Beside(2) as beside:
        assert beside.begin(os.getpid).result() != os.getpid()


def test_its_matrices_keep_to_one_thread_and_its_memory_is_its_own():
    held = np.ones(60_000_000)  # 480 MB, which a process is born with as its peak
    with Beside(2) as beside:
        beside.begin(np.sum, np.ones(3)).result()
        libraries = beside.begin(threadpool_info).result()
    assert {one["num_threads"] for one in libraries if one["user_api"] == "blas"} <= {1}
    assert held[-1] == 1.0 and beside.peak_mb < 400


def test_what_a_library_prints_is_no_answer():
    with Beside(2) as beside:
        assert beside.begin(print, "hello").result() is None
        assert beside.begin(os.system, "echo hello").result() == 0


def test_what_a_killed_process_leaves_is_done_here():
    with Beside(2) as beside:
        os.kill(beside.begin(os.getpid).result(), signal.SIGTERM)
        assert beside.begin(os.getpid).result() == os.getpid()
        assert beside.begin(np.sum, np.ones(3)).result() == 3.0


def test_it_ends_with_what_uses_it_whatever_it_does():
    with Beside(2) as beside:
        beside.begin(os.getpid).result()
        beside.begin(time.sleep, 600.0)
    assert beside._process.returncode is not None


def test_it_ends_when_the_first_process_is_killed():
    code = (
        "import os, sys; from facewright.beside import Beside; beside = Beside(2); beside.begin(os.getpid).result()\n"
        "import time; beside.begin(time.sleep, 1); time.sleep(0.2)\n"
        "sys.stdout.close(); os.kill(os.getpid(), 9)"
    )
    # Both write into the pipe of the first one's stderr, which is read to its end: until neither runs.
    first = subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE, timeout=60)
    assert first.returncode != 0 and not first.stderr
