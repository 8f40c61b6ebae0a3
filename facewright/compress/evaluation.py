"""How good a compression is: the paper's figures, on any set of textures.

RMSE is taken in 0-255 units over covered texels and channels, of the stored form decoded as the shader does it and
clipped. A set's figure is the mean over its textures.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from facewright.compress.encode import FacezipOptions, facezip
from facewright.compress.masks import build_masks, covered_texels
from facewright.compress.packed import Packed, decode_float
from facewright.compress.published import published_search
from facewright.compress.tiles import TextureTiles

METHODS = {
    "PCA(4)": FacezipOptions("pca", textures=4),
    "PCA(8)": FacezipOptions("pca", textures=8),
    "no permutation": FacezipOptions("paper", textures=4, permute=False),
    "published": FacezipOptions("paper", textures=4),
    "refined": FacezipOptions(),
}
MASK_COUNTS = (5, 13, 23, 33, 43, 53, 63, 83)


@dataclass(frozen=True)
class TextureSet:
    """Images to compress: neutral (h, w, C), textures N like it, names, mesh with UVs, covered (h, w) bool.

    truth  N images (h, w, C) float32 in 0-255 units, where the textures are these with noise; or None
    """

    neutral: np.ndarray
    textures: list
    names: tuple
    mesh: object
    covered: np.ndarray
    truth: list | None = None

    @classmethod
    def of(cls, neutral, textures, names, mesh, truth=None):
        """A set whose covered texels are those of the mesh."""
        covered = covered_texels(mesh.uv, mesh.uv_faces, *neutral.shape[:2])
        return cls(neutral, list(textures), tuple(names), mesh, covered, truth)


@dataclass(frozen=True)
class Outcome:
    """One method on one set: per texture RMSE (0-255), PSNR (dB) and SSIM; bytes, seconds, and the Packed itself.

    truth_rmse  (N,) against the noise-free truth, or None
    """

    method: str
    rmse: np.ndarray
    ssim: np.ndarray
    memory_bytes: int
    seconds: float
    packed: Packed
    truth_rmse: np.ndarray | None = None
    report: dict = field(default_factory=dict)

    @property
    def psnr(self):
        """(N,) dB; infinite where nothing is lost."""
        with np.errstate(divide="ignore"):
            return 20 * np.log10(255 / self.rmse)


def run_method(textures, name, options):
    """Outcome of a method (a FacezipOptions) on a TextureSet."""
    started = time.perf_counter()
    packed = facezip(
        textures.neutral,
        textures.textures,
        names=textures.names,
        mesh=textures.mesh,
        covered=textures.covered,
        options=options,
    )
    seconds = time.perf_counter() - started
    return measure(textures, name, packed, seconds)


def measure(textures, name, packed, seconds=0.0):
    """Outcome of a Packed against the set it was made from."""
    differences = packed.difference_textures()
    rmse, ssim, truth = [], [], []
    for n, image in enumerate(textures.textures):
        decoded = decode_one(packed, n, differences)
        wanted = image.reshape(decoded.shape).astype(np.float32) * np.float32(packed.unit)
        rmse.append(rms_error(decoded, wanted, textures.covered))
        ssim.append(structural_similarity(decoded, wanted, textures.covered))
        if textures.truth is not None:
            truth.append(rms_error(decoded, textures.truth[n], textures.covered))
    return Outcome(
        name,
        np.array(rmse),
        np.array(ssim),
        packed.memory_bytes(),
        seconds,
        packed,
        np.array(truth) if truth else None,
        packed.report,
    )


def decode_one(packed, n, differences=None):
    """(h, w, C) float32 0-255, clipped: expression n at weight 1."""
    weights = np.zeros(len(packed.names))
    weights[n] = 1
    return np.clip(decode_float(packed, weights, differences), 0, 255)


def rms_error(image, wanted, covered):
    """Root of the mean squared difference over covered texels and channels."""
    return float(np.sqrt(np.mean((image[covered] - wanted[covered]) ** 2, dtype=np.float64)))


def structural_similarity(image, wanted, covered, sigma=1.5):
    """Mean SSIM of the luminance over covered texels (Wang 2004: Gaussian window of 1.5 texels, K 0.01 and 0.03)."""
    if image.shape[2] >= 3:
        image, wanted = (x[:, :, :3] @ np.float32([0.299, 0.587, 0.114]) for x in (image, wanted))
    else:
        image, wanted = image[:, :, 0], wanted[:, :, 0]

    def blur(x):
        return gaussian_filter(x, sigma, truncate=3.5)

    a, b = blur(image), blur(wanted)
    variance_a, variance_b = blur(image * image) - a * a, blur(wanted * wanted) - b * b
    both = blur(image * wanted) - a * b
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    value = (2 * a * b + c1) * (2 * both + c2) / ((a * a + b * b + c1) * (variance_a + variance_b + c2))
    return float(value[covered].mean())


def block_bound(textures, k=4, block=8):
    """(N,) RMSE of the rank-k truncation of every block in float: what no constant weights in a block can beat."""
    unit = np.float32(255.0 / np.iinfo(textures.neutral.dtype).max)
    neutral = textures.neutral.reshape(*textures.neutral.shape[:2], -1).astype(np.float32) * unit
    h, w, c = neutral.shape
    pad = (-h % block, -w % block)
    grid = ((h + pad[0]) // block, (w + pad[1]) // block)
    total, n = np.zeros(len(textures.textures)), len(textures.textures)
    rows_at_once = max(1, 64 * 1024 * 1024 // (n * (w + pad[1]) * block * c * 4))
    for start in range(0, grid[0], rows_at_once):
        rows = slice(start * block, min((start + rows_at_once) * block, h))
        base, cover = neutral[rows], textures.covered[rows]
        images = np.stack([x.reshape(h, w, c)[rows].astype(np.float32) * unit for x in textures.textures])
        x = (images - base) * cover[None, :, :, None]
        x = np.pad(x, ((0, 0), (0, -len(base) % block), (0, pad[1]), (0, 0)))
        shape = (n, x.shape[1] // block, block, grid[1], block, c)
        blocks = x.reshape(shape).transpose(1, 3, 0, 2, 4, 5).reshape(-1, n, block * block * c)
        v = np.linalg.eigh(blocks @ blocks.transpose(0, 2, 1))[1][:, :, -k:]
        low = v @ (v.transpose(0, 2, 1) @ blocks)
        low = low.reshape(shape[1], grid[1], n, block, block, c).transpose(2, 0, 3, 1, 4, 5)
        low = low.reshape(n, x.shape[1], -1, c)[:, : len(base), :w]
        error = (np.clip(low + base, 0, 255) - images) * cover[None, :, :, None]
        total += (error.astype(np.float64) ** 2).sum(axis=(1, 2, 3))
    return np.sqrt(total / (textures.covered.sum() * c))


def search_curves(textures, masks=53, restarts=100, seed=0):
    """The permutation search against the published one on identical masks, as a dict.

    history  (11, restarts) cost of every random restart, sweep by sweep; ours: cost by seed; search: the
    PermutationSearch; seconds of one search
    """
    tiles = TextureTiles.of(_image(textures.neutral), [_image(x) for x in textures.textures], textures.covered)
    values, _ = build_masks(textures.mesh, tiles.grid, masks, seed=seed)
    search = published_search(tiles, values, min(4, tiles.count), seed)[0]
    _, _, history = search.restarts(restarts, seed)
    ours, started = {}, time.perf_counter()
    for number in (0, 1):
        ours[number] = float(search.cost(search.solve(number)[None])[0])
    seconds = (time.perf_counter() - started) / 2
    return {"history": history, "ours": ours, "search": search, "seconds": seconds, "masks": search.m}


def mask_curve(textures, counts=MASK_COUNTS):
    """Rows (masks, RMSE published, RMSE without permutation, our cost, best, median and worst of 100 restarts).

    Counts beyond the mesh's vertices are left out.
    """
    rows = []
    for count in counts:
        curves = search_curves(textures, count)
        if rows and curves["masks"] == rows[-1][0]:
            break  # the mesh has no more vertices
        last = curves["history"][-1]
        errors = [
            facezip(
                textures.neutral,
                textures.textures,
                mesh=textures.mesh,
                covered=textures.covered,
                options=replace(METHODS[name], masks=count, textures=min(4, len(textures.textures))),
            ).report["mean_rmse"]
            for name in ("published", "no permutation")
        ]
        rows.append((curves["masks"], *errors, curves["ours"][0], last.min(), float(np.median(last)), last.max()))
    return rows


def _image(image):
    return image[:, :, None] if image.ndim == 2 else image
