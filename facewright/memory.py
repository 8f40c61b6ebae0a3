"""How much memory a process has taken."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path


def peak_memory_mb():
    """Peak resident memory of this process, MB."""
    try:
        import resource
    except ImportError:  # Windows
        return _peak_memory_windows_mb()
    # On Linux the figure of getrusage is inherited from who started the process.
    with suppress(OSError, IndexError, ValueError):
        return round(int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024.0, 1)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (1024.0 if sys.platform != "darwin" else 1024.0**2), 1)


def _peak_memory_windows_mb():
    import ctypes
    from ctypes import wintypes

    class Counters(ctypes.Structure):
        _fields_ = [("cb", wintypes.DWORD), ("faults", wintypes.DWORD)] + [
            (name, ctypes.c_size_t)
            for name in ("peak", "working", "qpp", "qp", "qpnp", "qnp", "pagefile", "peak_pagefile")
        ]

    counters = Counters(cb=ctypes.sizeof(Counters))
    process = ctypes.windll.kernel32.GetCurrentProcess()
    ctypes.windll.psapi.GetProcessMemoryInfo(process, ctypes.byref(counters), counters.cb)
    return round(counters.peak / 1024.0**2, 1)
