"""The comparison of methods as files: tables in CSV, plots and pictures of the errors."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np

from facewright.compress.evaluation import (
    METHODS,
    block_bound,
    decode_one,
    mask_curve,
    measure,
    run_method,
    search_curves,
)
from facewright.compress.folder import png_size, write_result
from facewright.compress.ktx2 import block_compressed, encoder_missing
from facewright.errors import InputError

SHOWN = ("PCA(8)", "published", "refined")
TABLES = ("table.csv", "expressions.csv", "masks.csv", "restarts.csv", "figures.json")
FILES = (*TABLES, "errors.png", "permutation.png", "masks.png", "worst.png", "median.png")
ERROR_LIMIT = 32.0


def compare(textures, progress=None):
    """Everything that write_comparison writes, of a TextureSet: outcomes by method, bound, search, masks, bytes."""
    progress = progress or (lambda stage, share: None)
    outcomes = {}
    for step, (name, options) in enumerate(METHODS.items()):
        if options.method == "paper" and len(outcomes["PCA(4)"].packed.weights) < options.textures:
            continue  # fewer different textures than clusters
        outcomes[name] = run_method(textures, name, options)
        progress("compressing", (step + 1) / len(METHODS))
    result = {"outcomes": outcomes, "bound": block_bound(textures), "raw_bytes": raw_bytes(textures)}
    result["disk_bytes"] = {name: png_size(outcome.packed) for name, outcome in outcomes.items()}
    if not encoder_missing("bc7") and textures.neutral.dtype == np.uint8:
        refined = outcomes["refined"].packed
        result["bc7"] = {
            "differences": measure(textures, "differences in BC7", block_compressed(refined, neutral=False)),
            "all": measure(textures, "all in BC7", block_compressed(refined)),
        }
    progress("block compression", 1.0)
    if "published" in outcomes:
        result["search"] = search_curves(textures)
        result["masks"] = mask_curve(textures)
    progress("searching", 1.0)
    return result


def raw_bytes(textures):
    """Bytes of the neutral and all textures, uncompressed."""
    return int(textures.neutral.nbytes * (1 + len(textures.textures)))


def table_rows(result):
    """Header and rows of the main table: a row a method."""
    truth = any(o.truth_rmse is not None for o in result["outcomes"].values())
    header = ["method", "RMSE", "worst", "PSNR dB", "SSIM", "MB in memory", "MB as PNG", "seconds"]
    header += ["RMSE to truth"] if truth else []
    rows = []
    extra = list(result.get("bc7", {}).values())
    for outcome in [*result["outcomes"].values(), *extra]:
        disk, own = result["disk_bytes"].get(outcome.method), not any(outcome is other for other in extra)
        row = [outcome.method, outcome.rmse.mean(), outcome.rmse.max(), outcome.psnr.mean(), outcome.ssim.mean()]
        row += [outcome.memory_bytes / 1e6 if own else None, disk / 1e6 if disk else None]
        row += [outcome.seconds if own else None]
        rows.append(row + ([outcome.truth_rmse.mean()] if truth else []))
    bound = result["bound"]
    rows.append(["rank 4 of 8x8 blocks, float", bound.mean(), bound.max(), *[None] * (len(header) - 3)])
    return header, rows


def write_comparison(result, textures, folder):
    """Write table.csv, expressions.csv, masks.csv, restarts.csv, figures.json and the plots into an existing folder."""
    folder = Path(folder)
    header, rows = table_rows(result)
    _write_csv(folder / "table.csv", header, rows)
    outcomes = result["outcomes"]
    each = [
        [name, *(v for o in outcomes.values() for v in (o.rmse[n], o.psnr[n], o.ssim[n]))]
        for n, name in enumerate(textures.names)
    ]
    columns = [f"{name} {what}" for name in outcomes for what in ("RMSE", "PSNR", "SSIM")]
    _write_csv(folder / "expressions.csv", ["expression", *columns], each)
    if "search" in result:
        search = result["search"]
        names = ["masks", "published", "no permutation", "our cost", "best restart", "median restart", "worst restart"]
        _write_csv(folder / "masks.csv", names, result["masks"])
        sweeps = [[sweep, *costs] for sweep, costs in enumerate(search["history"].tolist())]
        _write_csv(folder / "restarts.csv", ["sweep", *range(search["history"].shape[1])], sweeps)
    write_result(folder / "figures.json", plain_figures(result).encode())
    _write_plots(result, textures, folder)


def plain_figures(result):
    """The main table and the search as JSON text; what is infinite (the PSNR of what is exact) as null."""
    header, rows = table_rows(result)
    rows = [[None if isinstance(v, float) and not np.isfinite(v) else v for v in row] for row in rows]
    figures = {"raw_bytes": result["raw_bytes"], "table": [dict(zip(header, row)) for row in rows]}
    if "search" in result:
        search = result["search"]
        best = float(search["history"][-1].min())
        figures["search"] = {"best_restart": best, "ours": search["ours"], "seconds": search["seconds"]}
    return json.dumps(figures, indent=1, default=float)


def _write_csv(path, header, rows):
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([f"{v:.6g}" if isinstance(v, float | np.floating) else v for v in row] for row in rows)
    write_result(path, stream.getvalue().encode())


def _write_plots(result, textures, folder):
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError("evaluate: the plots need matplotlib; pip install matplotlib") from None

    def save(figure, name):
        stream = io.BytesIO()
        figure.savefig(stream, dpi=110)
        write_result(folder / name, stream.getvalue())

    outcomes = result["outcomes"]
    figure = Figure((max(7, 0.45 * len(textures.names) + 2), 4.2), layout="constrained")
    axes = figure.subplots()
    width = 0.8 / len(outcomes)
    for i, (name, outcome) in enumerate(outcomes.items()):
        axes.bar(np.arange(len(outcome.rmse)) + (i - len(outcomes) / 2 + 0.5) * width, outcome.rmse, width, label=name)
    axes.set_xticks(range(len(textures.names)), textures.names, rotation=60, ha="right", fontsize=7)
    axes.set_ylabel("RMSE, 0-255")
    axes.set_title("Reconstruction error of every texture")
    figure.legend(loc="outside right upper", fontsize=8)
    save(figure, "errors.png")
    if "search" in result:
        save(_search_figure(Figure((6, 4), layout="constrained"), result["search"]), "permutation.png")
        save(_mask_figure(Figure((6, 4), layout="constrained"), result["masks"]), "masks.png")
    order = np.argsort(outcomes["refined"].rmse)
    for name, n in (("worst.png", order[-1]), ("median.png", order[len(order) // 2])):
        save(_error_figure(Figure((12, 6.4), layout="constrained"), outcomes, textures, int(n)), name)


def _search_figure(figure, search):
    axes = figure.subplots()
    axes.plot(search["history"], color="0.7", linewidth=0.5)
    axes.plot([], color="0.7", label=f"{search['history'].shape[1]} random restarts")
    axes.axhline(min(search["ours"].values()), color="tab:red", label="descent with kicks")
    axes.set_xlabel("sweep")
    axes.set_ylabel("permutation cost (Eq. 3)")
    axes.set_title(f"Search, {search['masks']} masks")
    axes.legend()
    return figure


def _mask_figure(figure, rows):
    axes = figure.subplots()
    rows = np.array(rows, float)
    axes.plot(rows[:, 0], rows[:, 1], "o-", label="published")
    axes.plot(rows[:, 0], rows[:, 2], "o--", label="no permutation")
    axes.set_xlabel("masks")
    axes.set_ylabel("mean RMSE, 0-255")
    axes.set_ylim(0, 1.1 * rows[:, 1:3].max())
    axes.set_title("Error against the number of masks")
    axes.legend()
    return figure


def _error_figure(figure, outcomes, textures, n):
    """Texture n as it is, as each method has it, and the error of each on one scale."""
    from matplotlib import colormaps

    unit = 255.0 / np.iinfo(textures.neutral.dtype).max
    wanted = textures.textures[n].reshape(*textures.neutral.shape[:2], -1).astype(np.float32) * unit
    step = max(1, max(wanted.shape[:2]) // 700)
    shown = [name for name in SHOWN if name in outcomes]
    axes = figure.subplots(2, 1 + len(shown), squeeze=False)
    figure.suptitle(f"{textures.names[n]}; error: mean over channels, dark 0, bright {ERROR_LIMIT:.0f} and more")
    axes[0, 0].imshow(_rgb(wanted[::step, ::step]))
    axes[0, 0].set_title("original")
    axes[1, 0].imshow(_rgb(np.float32(textures.neutral.reshape(wanted.shape)[::step, ::step] * unit)))
    axes[1, 0].set_title("neutral")
    for i, name in enumerate(shown, 1):
        image = decode_one(outcomes[name].packed, n)
        error = np.abs(image - wanted).mean(axis=2) * textures.covered
        axes[0, i].imshow(_rgb(image[::step, ::step]))
        axes[0, i].set_title(f"{name}, RMSE {outcomes[name].rmse[n]:.2f}")
        axes[1, i].imshow(colormaps["magma"](np.clip(error[::step, ::step] / ERROR_LIMIT, 0, 1)))
    for each in axes.ravel():
        each.set_axis_off()
    return figure


def _rgb(image):
    image = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    return image[:, :, :3] if image.shape[2] >= 3 else np.repeat(image[:, :, :1], 3, axis=2)
