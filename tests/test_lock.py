"""One at a time holds a lock, and it ends with its process."""

import os
import subprocess
import sys

import pytest

from facewright.lock import Locked, locked


def test_a_second_holder_is_told_of_the_first(tmp_path):
    with locked(tmp_path / "lock"):
        with pytest.raises(Locked) as refused, locked(tmp_path / "lock"):
            pass
        assert refused.value.owner == str(os.getpid())
    with locked(tmp_path / "lock"):
        pass


def test_the_lock_of_a_killed_process_is_free(tmp_path):
    code = "import sys, time; from pathlib import Path; from facewright.lock import locked\n"
    code += "with locked(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    process = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "lock")], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    with pytest.raises(Locked) as refused, locked(tmp_path / "lock"):
        pass
    assert refused.value.owner == str(process.pid)
    process.kill()
    process.communicate()
    with locked(tmp_path / "lock"):
        assert (tmp_path / "lock").read_text() == str(os.getpid())
