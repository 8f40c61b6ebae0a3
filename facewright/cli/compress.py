"""Compress a folder of aligned expression textures into a few difference textures and small weight maps (FaceZip).

facewright compress TEXTURES/ --neutral neutral.png --mesh neutral.obj --out packed/
"""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

from facewright.errors import InputError

HELP = "compress expression textures (FaceZip)"
UNITS = {"": 1, "B": 1, "KB": 1e3, "MB": 1e6, "GB": 1e9, "KIB": 2**10, "MIB": 2**20, "GIB": 2**30}


def add_arguments(parser):
    """Arguments of `facewright compress`."""
    parser.add_argument("textures_folder", metavar="TEXTURES", help="folder of images, one for each expression")
    parser.add_argument("--neutral", required=True, metavar="IMAGE", help="the neutral texture")
    parser.add_argument("--mesh", required=True, metavar="OBJ", help="the mesh with UVs that the textures belong to")
    parser.add_argument("--out", required=True, metavar="FOLDER", help="folder for the packed set")
    parser.add_argument("--method", choices=("refined", "paper"), default="refined", help="default: refined")
    parser.add_argument("--masks", type=int, metavar="N", help="masks of --method paper (default: 53)")
    parser.add_argument(
        "--textures",
        type=int,
        help="difference textures (default: 4, or 3 with finer weight maps where that leaves less in the same memory)",
    )
    parser.add_argument(
        "--budget", metavar="SIZE", help="for example 8MB: as many difference textures as fit in memory"
    )
    parser.add_argument("--region", metavar="IMAGE", help="where --method paper samples its masks")
    parser.add_argument("--keep", action="append", default=[], metavar="NAME", help="store this texture exactly")
    parser.add_argument(
        "--priority",
        metavar="IMAGE",
        help="grey image: white counts ten times as much as black; helps fine lines (3 texels), hardly whole regions",
    )
    parser.add_argument(
        "--examples", metavar="CSV", help="weights of example-based shapes: rows textures, columns shapes"
    )
    parser.add_argument(
        "--also",
        nargs=3,
        action="append",
        default=[],
        metavar=("NAME", "FOLDER", "NEUTRAL"),
        help="another map of the same expressions (specular, displacement ...), with shared weights where that pays",
    )
    parser.add_argument("--align", action="store_true", help="warp textures that lie off the neutral back onto it")
    parser.add_argument("--ktx2", choices=("bc7", "astc", "none"), default="bc7", help="KTX2 beside PNG (default: bc7)")
    parser.add_argument("--quiet", action="store_true", help="no progress")


def run(options):
    """Read, compress, write; the set appears whole."""
    from facewright.compress import FacezipOptions, facezip_maps
    from facewright.compress.files import read_examples, read_mask, read_texture, read_uv_mesh
    from facewright.compress.folder import choose_ktx2, files_of, publishing, write_packed
    from facewright.compress.packed import with_examples
    from facewright.output import OutputFolder

    if options.masks is not None and options.masks < 1:
        raise InputError(f"compress: --masks {options.masks}; at least 1 is needed")
    for name in ("masks", "region"):
        if getattr(options, name) is not None and options.method != "paper":
            raise InputError(f"compress: --{name} works with --method paper only; refined finds its weights everywhere")
    budget = None if options.budget is None else parse_size(options.budget)
    sources = list_maps(options)
    read = [path for neutral, paths in sources.values() for path in (neutral, *paths.values())]
    keep_apart(options.out, [*read, options.region, options.priority])
    names = list(next(iter(sources.values()))[1])
    neutral, mesh = read_texture(options.neutral), read_uv_mesh(options.mesh)
    region = None if options.region is None else read_mask(options.region, neutral.shape[:2]) > 0.5
    priority = None if options.priority is None else 1 + 9 * read_mask(options.priority, neutral.shape[:2])
    examples, strangers = None, []
    if options.examples is not None:
        *examples, strangers = read_examples(options.examples, names)
    shapes = None if examples is None else len(examples[0])
    masks = {} if options.masks is None else {"masks": options.masks}
    chosen = FacezipOptions(options.method, options.textures, **masks, budget=budget, shapes=shapes)
    reader = _Reader(sources, mesh, options.align)
    with Progress(options.quiet) as progress, OutputFolder(options.out).taken_back_on_failure():
        packed = facezip_maps(
            {name: (reader.neutral(name), reader.of(name)) for name in sources},
            names,
            mesh=mesh,
            region=region,
            priority=priority,
            keep=options.keep,
            options=chosen,
            progress=progress,
        )
        results = packed
        if examples is not None:
            results = {name: with_examples(each, *examples) for name, each in packed.items()}
        with publishing(options.out, files_of(options.out)) as folder:
            ktx2, missing = choose_ktx2(options.ktx2)
            started = time.perf_counter()
            about = write_packed(results, folder, ktx2, progress)
            written = time.perf_counter()
            notes = [missing, *write_previews(results, folder, reader, names, examples)]
    print_summary(packed, about, reader, examples, results)
    print(f"files {written - started:.1f} s, preview {time.perf_counter() - written:.1f} s: {options.out}")
    for note in filter(None, [*reader.notes(options.align), *notes, rows_left_out(options.examples, strangers)]):
        print(note)


def list_maps(options):
    """dict map -> (path of its neutral, dict expression -> path); all maps have the same expressions."""
    from facewright.compress.files import list_textures
    from facewright.write.files import file_name

    found = {"color": (options.neutral, options.textures_folder)}
    for name, folder, neutral in options.also:
        if file_name(name) in map(file_name, found):
            raise InputError(f"compress: two maps are called {name!r}; give every --also a name of its own")
        found[name] = (neutral, folder)
    maps = {}
    for name, (neutral, folder) in found.items():
        paths = {path.stem: path for path in list_textures(folder, neutral)}
        first = next(iter(maps.values()), (None, paths))[1]
        if set(paths) != set(first):
            odd = sorted(set(paths) ^ set(first))[0]
            raise InputError(f"compress: {odd} is not in both {options.textures_folder} and {folder}; name them alike")
        maps[name] = (neutral, {stem: paths[stem] for stem in first})
    return maps


def keep_apart(out, inputs):
    """InputError where images to read lie in the folder of the result, which would replace them or mix with them."""
    for path in filter(None, inputs):
        if Path(path).resolve().parent == Path(out).resolve():
            raise InputError(f"{path} lies in --out {out}; give the result a folder of its own")


def parse_size(text):
    """Bytes of "8MB", "500 KiB" or "1e7"."""
    match = re.fullmatch(r"\s*([0-9.]+(?:e[0-9]+)?)\s*([a-zA-Z]*)\s*", text)
    try:
        return int(float(match[1]) * UNITS[match[2].upper()])
    except (TypeError, ValueError, KeyError, OverflowError):
        raise InputError(f"compress: --budget {text!r} is no size; write for example 8MB or 500KiB") from None


def write_previews(packed, folder, reader, names, examples):
    """preview.html of the first map, preview_NAME.html of the others; returns sentences on what is left out."""
    from facewright.compress.folder import preview_name, write_result
    from facewright.compress.preview import preview_missing, preview_page

    notes = []
    B = None if examples is None else examples[1]
    for number, (name, one) in enumerate(packed.items()):
        missing = preview_missing(one)
        if missing:
            notes.append(missing)
            continue
        page = preview_page(one, reader.of(name), len(names), title=f"FaceZip: {name}", examples=B)
        write_result(folder / preview_name(number, name), page.encode())
    return notes


def rows_left_out(table, strangers):
    """The sentence on rows of the table of shapes whose textures are not in the set, if any."""
    if not strangers:
        return ""
    named = ", ".join(strangers[:6]) + (", ..." if len(strangers) > 6 else "")
    return f"{table}: {counted(len(strangers), 'row')} left out, of textures that are not in the set: {named}"


def counted(count, what):
    """ "1 texture", "2 textures"."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def print_summary(packed, about, reader, examples, results):
    """Bytes and errors, a line a map."""
    size = about["bytes"]
    count = len(next(iter(packed.values())).names)
    raw = sum(one.neutral.nbytes * (count + 1) for one in packed.values()) / 1e6
    sizes = f"{size['memory'] / 1e6:.2f} MB in memory, {size['png'] / 1e6:.2f} as PNG, raw {raw:.1f}"
    print(f"{counted(count, 'texture')}: {sizes}")
    if "ktx2" in size:
        print(f"KTX2 with mip-maps: {size['ktx2'] / 1e6:.2f} MB on disk, {size['memory_ktx2'] / 1e6:.2f} in GPU memory")
    for name, one in packed.items():
        rmse, report = one.report["rmse"], one.report
        worst = max(rmse, key=rmse.__getitem__)
        reading, whole = report["seconds"]["reading"], sum(report["seconds"].values())
        stored = counted(len(one.textures), "difference texture")
        print(f"{name}: {stored}, {whole - reading:.1f} s, reading {reading:.1f} s")
        print(f"{name}: RMSE {report['mean_rmse']:.2f} of 255, worst {worst} {rmse[worst]:.2f}")
        if "masks" in report:
            masks, radius = counted(report["masks"], "mask"), report["radius_mm"]
            print(f"{name}: {masks} {radius:.1f} apart, down to {report['lowest_before_clip']:.2f} before clipping")
        if report["solution"] == "exact":
            step = one.texture_step[(one.textures != one.texture_zero[:, None, None]).any(axis=(1, 2))].max(initial=0)
            print(f"{name}: exact but for the rounding of the stored step, {step:.3f} of 255")
        if "mean_rmse_shared" in report:
            pair = (
                f"RMSE {report['mean_rmse_shared']:.2f} with shared weights, {report['mean_rmse_alone']:.2f} with own"
            )
            print(f"{name}: {pair}")
    if examples is not None:
        report = next(iter(results.values())).report
        holds = "" if report["full_row_rank"] else "; the table has no full row rank, so shapes only come near (Eq. 10)"
        print(f"{len(examples[0])} shapes, weights within {report['largest_weight_error']:.4f} of the textures'{holds}")


class _Reader:
    """Reads textures of every map, and warps those that lie off the neutral by the shift of the first map."""

    def __init__(self, sources, mesh, align):
        self.sources, self.mesh, self.align = sources, mesh, align
        self.neutrals, self.shifts, self.covered = {}, {}, None

    def neutral(self, name):
        """The neutral of a map."""
        from facewright.compress.files import read_texture

        if name not in self.neutrals:
            self.neutrals[name] = read_texture(self.sources[name][0])
        return self.neutrals[name]

    def of(self, name):
        """Function n -> image of a map."""
        paths = list(self.sources[name][1].values())
        return lambda n: self._read(name, paths[n])

    def _read(self, name, path):
        from facewright.compress.align import align_texture
        from facewright.compress.files import read_texture

        image = read_texture(path)
        if image.shape != self.neutral(name).shape:
            return image  # facezip says what is wrong
        shift = self._shift(path.stem, image if name == next(iter(self.sources)) else None)
        return align_texture(image, shift) if self.align and shift is not None and shift.misaligned else image

    def _shift(self, stem, image):
        from facewright.compress.align import measure_shift
        from facewright.compress.files import read_texture
        from facewright.compress.masks import covered_texels

        if stem not in self.shifts:
            first = next(iter(self.sources))
            neutral = self.neutral(first)
            image = read_texture(self.sources[first][1][stem]) if image is None else image
            if self.covered is None:
                self.covered = covered_texels(self.mesh.uv, self.mesh.uv_faces, *neutral.shape[:2])
            shift = measure_shift(neutral, image, self.covered) if image.shape == neutral.shape else None
            if shift is not None and not (self.align and shift.misaligned):
                shift = shift.without_flow()
            self.shifts[stem] = shift
        return self.shifts[stem]

    def notes(self, align):
        """Sentences on misaligned textures."""
        off = {stem: shift for stem, shift in self.shifts.items() if shift is not None and shift.misaligned}
        if not off:
            return []
        worst = max(off, key=lambda stem: off[stem].p95)
        many = f"{counted(len(off), 'texture')} {'lies' if len(off) == 1 else 'lie'}"
        told = f"{many} off the neutral, {worst} by up to {off[worst].p95:.1f} texels"
        return [f"{told}: warped back" if align else f"{told}; --align warps them back"]


class Progress:
    """The stage, the share done and the time left, on standard error."""

    def __init__(self, quiet=False):
        self.quiet = quiet
        self.stage, self.started = None, 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.stage is not None:  # what follows gets a line of its own
            sys.stderr.write("\n")

    def __call__(self, stage, share):
        if self.quiet:
            return
        now = time.perf_counter()
        if stage != self.stage:
            if self.stage is not None:
                sys.stderr.write("\n")
            self.stage, self.started, self.first = stage, now, share
        # The first report of a stage starts its clock.
        done = share - self.first
        left = f", about {(now - self.started) * (1 - share) / done:.0f} s left" if done > 0 else ""
        sys.stderr.write(f"\r{stage} {share:4.0%}{left}        " + ("\n" if share >= 1 else ""))
        if share >= 1:
            self.stage = None
        sys.stderr.flush()
