import numpy as np

from facewright.memory import peak_memory_mb


def test_peak_memory_grows_with_what_is_held():
    before = peak_memory_mb()
    held = np.ones(30_000_000)
    assert peak_memory_mb() >= before and held[-1] == 1
