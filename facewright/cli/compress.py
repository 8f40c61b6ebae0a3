"""Compress a folder of aligned expression textures into a few difference textures and small weight maps (FaceZip).

facewright compress TEXTURES/ --neutral neutral.png --mesh neutral.obj --out packed/
"""

from __future__ import annotations

import shutil
import sys

from facewright.errors import InputError

HELP = "compress expression textures (FaceZip)"


def add_arguments(parser):
    """Arguments of `facewright compress`."""
    parser.add_argument("textures_folder", metavar="TEXTURES", help="folder of images, one for each expression")
    parser.add_argument("--neutral", required=True, metavar="IMAGE", help="the neutral texture")
    parser.add_argument("--mesh", required=True, metavar="OBJ", help="the mesh with UVs that the textures belong to")
    parser.add_argument("--out", required=True, metavar="FOLDER", help="folder for the packed set")
    parser.add_argument("--method", choices=("refined", "paper"), default="refined", help="default: refined")
    parser.add_argument("--masks", type=int, default=53, help="masks of --method paper (default: 53)")
    parser.add_argument("--textures", type=int, default=4, help="difference textures (default: 4)")
    parser.add_argument("--region", metavar="IMAGE", help="where --method paper samples its masks")
    parser.add_argument("--keep", action="append", default=[], metavar="NAME", help="store this texture exactly")
    parser.add_argument("--priority", metavar="IMAGE", help="grey image: white counts ten times as much as black")
    parser.add_argument("--quiet", action="store_true", help="no progress")


def run(options):
    """Read, compress, write; the folder appears whole."""
    from facewright.compress import FacezipOptions, facezip
    from facewright.compress.files import list_textures, read_mask, read_texture, read_uv_mesh, write_packed
    from facewright.output import OutputFolder

    if options.masks < 1:
        raise InputError(f"compress: --masks {options.masks}; at least 1 is needed")
    paths = list_textures(options.textures_folder, options.neutral)
    neutral, mesh = read_texture(options.neutral), read_uv_mesh(options.mesh)
    region = None if options.region is None else read_mask(options.region, neutral.shape[:2]) > 0.5
    priority = None if options.priority is None else 1 + 9 * read_mask(options.priority, neutral.shape[:2])
    chosen = FacezipOptions(method=options.method, textures=options.textures, masks=options.masks)
    output = OutputFolder(options.out)
    output.make()
    try:
        packed = facezip(
            neutral,
            lambda n: read_texture(paths[n]),
            names=[p.stem for p in paths],
            mesh=mesh,
            region=region,
            priority=priority,
            keep=options.keep,
            options=chosen,
            progress=None if options.quiet else _Progress(),
        )
        with output.workshop() as folder:
            write_packed(packed, folder)
            output.publish(folder)
    except BaseException:
        output.remove_what_is_new()
        raise
    shutil.rmtree(output.stages, ignore_errors=True)
    worst = max(packed.report["rmse"], key=packed.report["rmse"].get)
    rmse, size = packed.report["rmse"], packed.memory_bytes() / 1e6
    worst = max(rmse, key=rmse.__getitem__)
    print(f"{len(paths)} textures in {size:.1f} MB, raw {neutral.nbytes * (len(paths) + 1) / 1e6:.1f}: {options.out}")
    print(f"RMSE {packed.report['mean_rmse']:.2f} of 255, worst {worst} {rmse[worst]:.2f}")


class _Progress:
    """The share done and the time left, on standard error."""

    def __init__(self):
        import time

        self.clock, self.started = time.perf_counter, time.perf_counter()

    def __call__(self, share):
        left = (self.clock() - self.started) * (1 - share) / share
        sys.stderr.write(f"\rrefining {share:4.0%}, about {left:.0f} s left " + ("\n" if share >= 1 else ""))
        sys.stderr.flush()
