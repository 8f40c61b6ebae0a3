"""FaceZip on a set of textures: time, error against PCA and the rank-4 blocks, and the permutation search.

python bench/compression.py SET/     with neutral.png, mesh.obj and textures/
"""

import sys
import time
from pathlib import Path

import numpy as np

from facewright.compress import FacezipOptions, facezip, facezip_decode
from facewright.compress.encode import published_search
from facewright.compress.files import list_textures, read_texture, read_uv_mesh
from facewright.compress.masks import build_masks, covered_texels
from facewright.compress.tiles import TextureTiles


def rmse(images, textures, covered):
    """Mean and worst RMSE of 8-bit images on covered texels."""
    errors = [np.sqrt(np.mean((a[covered].astype(float) - b[covered]) ** 2)) for a, b in zip(images, textures)]
    return float(np.mean(errors)), float(np.max(errors))


def low_rank(neutral, textures, k, covered, block=None):
    """Textures of rank k in float, of the whole set (PCA) or of every block of so many texels."""
    x = np.stack([t.astype(np.float32) - neutral for t in textures]) * covered[:, :, None]
    n, h, w, c = x.shape
    if block is None:
        x = x.reshape(1, n, -1)
    else:
        x = (
            x.reshape(n, h // block, block, w // block, block, c)
            .transpose(1, 3, 0, 2, 4, 5)
            .reshape(-1, n, block**2 * c)
        )
    _, vectors = np.linalg.eigh(x @ x.transpose(0, 2, 1))
    v = vectors[:, :, -k:]
    x = v @ (v.transpose(0, 2, 1) @ x)
    if block is not None:
        x = x.reshape(h // block, w // block, n, block, block, c).transpose(2, 0, 3, 1, 4, 5)
    return np.clip(x.reshape(n, h, w, c) + neutral, 0, 255)


def main(folder):
    """Print every figure of a set."""
    paths = list_textures(folder / "textures", folder / "neutral.png")
    neutral, textures = read_texture(folder / "neutral.png"), [read_texture(path) for path in paths]
    mesh = read_uv_mesh(folder / "mesh.obj")
    covered = covered_texels(mesh.uv, mesh.uv_faces, *neutral.shape[:2])
    for name, k, block in (("PCA(4), float", 4, None), ("PCA(8), float", 8, None), ("rank 4 of 8x8 blocks", 4, 8)):
        print(
            f"{name:28s} mean %.3f  worst %.3f"
            % rmse(low_rank(neutral, textures, k, covered, block), textures, covered)
        )
    eye = np.eye(len(textures))
    runs = {"published, no permutation": FacezipOptions("paper", permute=False), "published": FacezipOptions("paper")}
    for name, options in {**runs, "refined": FacezipOptions()}.items():
        start = time.perf_counter()
        packed = facezip(neutral, textures, mesh=mesh, options=options)
        seconds = time.perf_counter() - start
        figures = rmse([facezip_decode(packed, row) for row in eye], textures, covered)
        print(f"{name:28s} mean %.3f  worst %.3f  {seconds:.2f} s  {packed.memory_bytes()} bytes" % figures)
    tiles = TextureTiles.of(neutral, textures, covered)
    masks, _ = build_masks(mesh, tiles.grid, 53)
    search = published_search(tiles, masks, 4)[0]
    best = search.restarts(100)[0].min()
    for seed in (0, 1):
        start = time.perf_counter()
        cost = search.cost(search.solve(seed)[None])[0]
        print(
            f"search, seed {seed}: {100 * (1 - cost / best):.1f} % below restarts, {time.perf_counter() - start:.2f} s"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
