import os
import signal
import sys

import numpy as np
import pytest

from facewright.beside import Beside
from facewright.errors import StageError


def failing():
    raise StageError("bake", "empty", "nothing is seen", {"share": 0.5})


def killed_where_there_is_a_second_process(here):
    if os.getpid() != here:
        os.kill(os.getpid(), signal.SIGKILL if sys.platform != "win32" else signal.SIGTERM)
    return "done here"


@pytest.mark.parametrize("jobs", [1, 2])
def test_work_is_done_wherever_it_is_done(jobs):
    values = np.arange(1000.0)
    with Beside(jobs) as beside:
        begun = [beside.begin(np.sum, values[:count]) for count in (10, 1000)]
        assert [work.result() for work in begun] == [45.0, 499500.0]
        assert (beside.begin(os.getpid).result() == os.getpid()) == (jobs == 1)
        assert (beside.peak_mb > 10) == (jobs == 2)


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_goes_wrong_is_told_as_it_was(jobs):
    with Beside(jobs) as beside, pytest.raises(StageError, match="nothing is seen") as failure:
        beside.begin(failing).result()
    assert failure.value.outcome == "empty" and failure.value.stats == {"share": 0.5}


def test_what_a_killed_process_leaves_is_done_here():
    with Beside(2) as beside:
        assert beside.begin(killed_where_there_is_a_second_process, os.getpid()).result() == "done here"
        assert beside.begin(np.sum, np.ones(3)).result() == 3.0
