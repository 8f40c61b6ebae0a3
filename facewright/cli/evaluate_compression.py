"""The table and figures of `facewright evaluate compression`."""

from __future__ import annotations

from contextlib import nullcontext

from facewright.cli.compress import Progress, keep_apart
from facewright.errors import InputError


def evaluate(folder, options):
    """Compare PCA, the published method and the refined one on a folder of textures; print, and write with --out."""
    from facewright.compress.comparison import FILES, compare, plain_figures, table_rows, write_comparison
    from facewright.compress.evaluation import TextureSet
    from facewright.compress.files import list_textures, read_texture, read_uv_mesh
    from facewright.compress.folder import publishing
    from facewright.output import OutputFolder

    if options.neutral is None or options.mesh is None:
        raise InputError("evaluate compression: give --neutral IMAGE and --mesh OBJ of the textures")
    paths = list_textures(folder, options.neutral)
    if options.out is not None:
        keep_apart(options.out, [options.neutral, *paths])
    neutral, mesh = read_texture(options.neutral), read_uv_mesh(options.mesh)
    textures = TextureSet.of(neutral, [read_texture(path) for path in paths], [path.stem for path in paths], mesh)
    place = nullcontext() if options.out is None else OutputFolder(options.out).taken_back_on_failure()
    with Progress(options.json) as progress, place as out:
        result = compare(textures, progress)
        if out is not None:
            with publishing(out, [out / name for name in FILES]) as workshop:
                write_comparison(result, textures, workshop)
    if options.json:
        print(plain_figures(result))
        return
    print_result(result, *table_rows(result))


def print_result(result, header, rows):
    """The main table, the search and the masks in plain text."""
    print_columns(header, rows)
    print(f"raw: {result['raw_bytes'] / 1e6:.2f} MB")
    if "search" in result:
        search = result["search"]
        best = float(search["history"][-1].min())
        shares = {seed: 100 * (1 - cost / best) if best > 0 else 0.0 for seed, cost in search["ours"].items()}
        below = ", ".join(f"seed {seed} {share:.1f} %" for seed, share in shares.items())
        restarts = search["history"].shape[1]
        print(f"\npermutation cost below the best of {restarts} random restarts: {below}; {search['seconds']:.2f} s")
        print()
        print_columns(
            ["masks", "published", "no permutation", "our cost", "best restart"], [r[:5] for r in result["masks"]]
        )


def print_columns(header, rows):
    """A text table; numbers with three decimals, None as a dash."""
    cells = [[_cell(value) for value in row] for row in rows]
    widths = [max(len(head), *(len(row[i]) for row in cells)) for i, head in enumerate(header)]
    for row in [header, *cells]:
        first, *rest = (text.ljust(w) if i == 0 else text.rjust(w) for i, (text, w) in enumerate(zip(row, widths)))
        print("  ".join([first, *rest]))


def _cell(value):
    if value is None:
        return "-"
    if isinstance(value, str | int):
        return str(value)
    return f"{value:.3f}" if abs(value) < 1e5 else f"{value:.4g}"
