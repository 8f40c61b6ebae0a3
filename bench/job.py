"""Time and peak memory of the whole job, stage by stage.

    python bench/job.py [SCAN] [--template hm08] [--texture-size 2048] [--repeat 1]

Runs `facewright rig` in a process of its own into a fresh folder, so that the peak is the job's. Without SCAN: the real
scan beside the project if it is there, else the embedded sample. Memory is that of both its processes, sampled
ten times a second (Linux).
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from common import SCANS, Verdict, print_table

from facewright.sample import sample_path

BARS = {"seconds": 45.0, "peak MB": 3000.0}


def default_scan():
    """The real scan if it is here, else the sample."""
    real = SCANS / "lee-perry-smith" / "head.obj"
    return real if real.is_file() else sample_path()


def resident_mb(pid):
    """Resident memory of a process and its children now, MB; None where /proc is not there or the process is gone."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            after_name = stat.read_text().rpartition(")")[2].split()
            found[int(stat.parent.name)] = int(after_name[1]), int(after_name[21])
    if pid not in found:
        return None
    pages = found[pid][1] + sum(own for parent, own in found.values() if parent == pid)
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def run_job(scan, template, texture_size, out):
    """report.json of one job, its wall seconds, and samples [(seconds, MB)] of its memory."""
    command = [sys.executable, "-m", "facewright.cli", "rig", str(scan), "--out", str(out), "--quiet"]
    command += ["--template", str(template), "--texture-size", str(texture_size)]
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    samples = []
    while process.poll() is None:
        memory = resident_mb(process.pid)
        if memory is not None:
            samples.append((time.perf_counter() - began, memory))
        time.sleep(0.1)
    seconds = time.perf_counter() - began
    if process.returncode:
        raise SystemExit(f"the job ended with exit code {process.returncode}")
    return json.loads((out / "report.json").read_text()), seconds, samples


def stage_rows(report, seconds, samples):
    """(stage, seconds, peak MB) in order; what comes before the first stage is loading the libraries."""
    timings = report["timings_s"]
    start = max(seconds - sum(timings.values()), 0.0)
    rows, begin = [("load libraries and template", start, _peak(samples, 0.0, start))], start
    for stage, duration in timings.items():
        rows.append((stage, duration, _peak(samples, begin, begin + duration)))
        begin += duration
    return rows


def _peak(samples, begin, end):
    inside = [memory for at, memory in samples if begin <= at <= end]
    return max(inside) if inside else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scan", type=Path, nargs="?", default=default_scan())
    parser.add_argument("--template", default="hm08")
    parser.add_argument("--texture-size", type=int, default=2048)
    parser.add_argument("--repeat", type=int, default=1)
    options = parser.parse_args()
    verdict = Verdict()
    for number in range(options.repeat):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "result"
            report, seconds, samples = run_job(options.scan, options.template, options.texture_size, out)
        rows = stage_rows(report, seconds, samples)
        rows.append(("whole job", seconds, report["peak_memory_mb"]))
        cpu = f"{os.cpu_count()} cores, {platform.machine()}"
        print_table(f"{options.scan.name}, {options.texture_size} px, {cpu}", ("stage", "seconds", "peak MB"), rows)
        verdict.check(f"run {number + 1}", "seconds", seconds, BARS["seconds"])
        verdict.check(f"run {number + 1}", "peak MB", report["peak_memory_mb"], BARS["peak MB"])
    verdict.print()


if __name__ == "__main__":
    main()
