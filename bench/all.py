"""Every benchmark, one after the other: python bench/all.py [NAME ...]. Each also runs alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ORDER = (
    "transfer",
    "shapes",
    "bake",
    "registration_truth",
    "real_scans",
    "invariance",
    "clay_eyes",
    "job",
    "iris",
    "compression",
    "compression_web",
)


def main():
    names = sys.argv[1:] or [name for name in ORDER if (Path(__file__).parent / f"{name}.py").is_file()]
    failed = []
    for name in names:
        print(f"\n=== {name} ===", flush=True)
        if subprocess.run([sys.executable, str(Path(__file__).parent / f"{name}.py")]).returncode:
            failed.append(name)
    if failed:
        raise SystemExit(f"did not run to the end: {', '.join(failed)}")


if __name__ == "__main__":
    main()
