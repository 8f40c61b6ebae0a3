"""Face-like expression textures of known structure: local wrinkles that expressions share, hue shifts and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from facewright.read.raw import RawMesh

# Places of wrinkles on half a face: u, v of the centre (u from the middle line), reach in u and v, and of every pattern
# there its direction in degrees and furrows over the reach. Horizontal furrows run along u (direction 90).
PLACES = {
    "forehead": (0.11, 0.80, 0.16, 0.09, ((90, 3.0), (70, 5.0), (90, 7.0))),
    "glabella": (0.02, 0.68, 0.06, 0.07, ((0, 2.0), (25, 3.0))),
    "crow": (0.29, 0.62, 0.07, 0.07, ((80, 3.0), (100, 5.0))),
    "lower lid": (0.16, 0.56, 0.10, 0.05, ((90, 2.0), (75, 4.0))),
    "nose": (0.05, 0.54, 0.06, 0.08, ((60, 3.0), (90, 5.0))),
    "cheek": (0.24, 0.44, 0.14, 0.12, ((40, 2.0), (60, 4.0))),
    "fold": (0.13, 0.40, 0.06, 0.13, ((20, 1.5), (30, 3.0))),
    "mouth": (0.07, 0.30, 0.12, 0.07, ((0, 5.0), (90, 3.0), (20, 7.0))),
    "chin": (0.04, 0.18, 0.10, 0.08, ((90, 2.0), (45, 6.0))),
    "jaw": (0.27, 0.25, 0.10, 0.14, ((70, 2.0), (50, 4.0))),
}
BLUSHES = ((0.22, 0.46, 0.16), (0.0, 0.52, 0.08), (0.1, 0.8, 0.2), (0.0, 0.2, 0.14))
SKIN = np.array([196.0, 150.0, 128.0])


@dataclass(frozen=True)
class ExpressionSet:
    """A generated set: neutral (h, w, 3) uint8, textures N like it, truth N (h, w, 3) float32 0-255 without noise.

    mesh    a bowl whose UVs fill an ellipse; covered (h, w) bool
    names   of the textures; signal_rms of the true differences on covered texels, 0-255
    """

    neutral: np.ndarray
    textures: list
    truth: list
    mesh: RawMesh
    covered: np.ndarray
    names: tuple
    signal_rms: float


class ExpressionSource:
    """Expressions drawn one at a time, the same for the same arguments, whatever the order they are asked for in.

    size      of a square image, or (height, width)
    strength  amplitude of wrinkles, 0-255
    noise     standard deviation of the noise of every texture, the neutral too, 0-255
    """

    def __init__(self, size=512, *, strength=14.0, noise=2.0, seed=0):
        self.height, self.width = (size, size) if np.isscalar(size) else size
        self.strength, self.noise, self.seed = strength, noise, seed
        rng = np.random.default_rng(seed)
        self.clean = _neutral(self.height, self.width, rng)
        v, u = _axes(self.height, self.width)
        self.covered = ((u[None] - 0.5) / 0.46) ** 2 + ((v[:, None] - 0.5) / 0.48) ** 2 <= 1
        self.patterns = list(_patterns(u, v, rng))
        self.neutral = _with_noise(self.clean, noise, [seed, 2])
        self.mesh = bowl()

    def draw(self, n):
        """Texture n (h, w, 3) uint8 and its truth (h, w, 3) float32 without noise."""
        image = self.clean.copy()
        weights = _activation(len(self.patterns), np.random.default_rng([self.seed, 3, n]))
        for (rows, columns, pattern, colour), weight in zip(self.patterns, weights):
            if weight:
                image[rows, columns] += (np.float32(weight * self.strength) * pattern)[:, :, None] * colour
        image = np.clip(image, 0, 255)
        return _with_noise(image, self.noise, [self.seed, 1, n]), image


def expression_set(size=512, count=20, *, strength=14.0, noise=2.0, seed=0):
    """A deterministic ExpressionSet; arguments as of ExpressionSource."""
    source = ExpressionSource(size, strength=strength, noise=noise, seed=seed)
    drawn = [source.draw(n) for n in range(count)]
    squares = [((truth - source.clean)[source.covered] ** 2).mean() for _, truth in drawn]
    return ExpressionSet(
        neutral=source.neutral,
        textures=[texture for texture, _ in drawn],
        truth=[truth for _, truth in drawn],
        mesh=source.mesh,
        covered=source.covered,
        names=tuple(f"expression{n:02d}" for n in range(count)),
        signal_rms=float(np.sqrt(np.mean(squares))),
    )


def _axes(height, width):
    """v (height,) upwards and u (width,) of the texels' centres, float32."""
    v, u = 1 - (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width
    return v.astype(np.float32), u.astype(np.float32)


def bowl(rings=24, spokes=64):
    """A RawMesh like a face mask, mm, whose UVs fill an ellipse in the middle of the image."""
    radius = np.concatenate([[0.0], np.repeat(np.arange(1, rings + 1) / rings, spokes)])
    angle = np.concatenate([[0.0], np.tile(np.arange(spokes) / spokes * 2 * np.pi, rings)])
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    vertices = np.column_stack([80 * x, 110 * y, 70 * np.sqrt(np.maximum(1 - 0.8 * radius**2, 0))])
    uv = np.column_stack([0.5 + 0.46 * x, 0.5 + 0.48 * y])
    spoke = np.arange(spokes)
    following = (spoke + 1) % spokes
    faces = [np.column_stack([np.zeros(spokes, int), 1 + spoke, 1 + following])]
    for ring in range(rings - 1):
        inner, outer = 1 + ring * spokes, 1 + (ring + 1) * spokes
        faces.append(np.column_stack([inner + spoke, outer + spoke, outer + following]))
        faces.append(np.column_stack([inner + spoke, outer + following, inner + following]))
    faces = np.concatenate(faces)
    return RawMesh(vertices=vertices, faces=faces, uv=uv, uv_faces=faces)


def _neutral(height, width, rng):
    """(h, w, 3) float32: skin of uneven colour with brows, lips, freckles and pores."""
    v, u = _axes(height, width)
    image = np.empty((height, width, 3), np.float32)
    image[:] = SKIN
    for _ in range(30):
        place, reach = rng.random(2), rng.uniform(0.05, 0.3)
        image += _blob(u, v, *place, reach, reach)[:, :, None] * rng.normal(0, 4, 3).astype(np.float32)
    for side in (-1, 1):
        image -= _blob(u, v, 0.5 + side * 0.17, 0.69, 0.09, 0.018)[:, :, None] * np.float32([90, 80, 70])
    image += _blob(u, v, 0.5, 0.30, 0.10, 0.035)[:, :, None] * np.float32([-10, -55, -45])
    for _ in range(200):
        (cu, cv), reach = rng.random(2), rng.uniform(0.002, 0.006)
        rows, columns = _window(u, v, cu, cv, 4 * reach, 4 * reach)
        image[rows, columns] -= _blob(u[columns], v[rows], cu, cv, reach, reach)[:, :, None] * np.float32(
            rng.uniform(5, 30) * np.array([0.6, 1.0, 1.0])
        )
    pores = gaussian_filter(rng.standard_normal((height, width), dtype=np.float32), max(0.6, height / 700))
    image += (4.0 / pores.std()) * pores[:, :, None]
    return np.clip(image, 20, 235)


def _patterns(u, v, rng):
    """(rows, columns, pattern (r, c), colour (3,)) of every wrinkle and blush, left and right apart."""
    for centre_u, centre_v, reach_u, reach_v, kinds in PLACES.values():
        for degrees, furrows in kinds:
            colour = np.float32([1.0, 0.95, 0.9]) * rng.uniform(0.8, 1.2)
            phase, bend = rng.uniform(0, 2 * np.pi), rng.uniform(-1.5, 1.5)
            for side in (-1, 1):
                u0 = 0.5 + side * centre_u
                rows, columns = _window(u, v, u0, centre_v, 2.2 * reach_u, 2.2 * reach_v)
                x, y = side * (u[columns][None] - u0) / reach_u, (v[rows][:, None] - centre_v) / reach_v
                turn = np.deg2rad(degrees)
                along = np.cos(turn) * x + np.sin(turn) * y + 0.15 * bend * (x * x + y * y)
                wave = np.sin(2 * np.pi * furrows * along / 2 + phase)
                pattern = np.exp(-1.5 * (x * x + y * y)) * wave
                yield rows, columns, pattern.astype(np.float32), colour.astype(np.float32)
    for centre_u, centre_v, reach in BLUSHES:
        for side in (-1, 1) if centre_u else (1,):
            rows, columns = _window(u, v, 0.5 + side * centre_u, centre_v, 3 * reach, 3 * reach)
            blob = _blob(u[columns], v[rows], 0.5 + side * centre_u, centre_v, reach, reach)
            yield rows, columns, blob, np.float32([0.5, -0.35, -0.3])


def _activation(count, rng):
    """(count,) weights of the patterns in an expression: a third of them, most of them on both sides alike."""
    weights = rng.normal(0, 1, count) * (rng.random(count) < 0.33)
    for left in range(0, count - 1, 2):
        if rng.random() < 0.7:
            weights[left + 1] = weights[left]
    return weights


def _window(u, v, u0, v0, reach_u, reach_v):
    """Slices of rows and columns within reach."""
    columns = np.flatnonzero(np.abs(u - u0) <= reach_u)
    rows = np.flatnonzero(np.abs(v - v0) <= reach_v)
    return slice(rows[0], rows[-1] + 1) if len(rows) else slice(0, 0), (
        slice(columns[0], columns[-1] + 1) if len(columns) else slice(0, 0)
    )


def _blob(u, v, u0, v0, reach_u, reach_v):
    """(rows, columns) float32 bell of height 1."""
    across = np.exp(-(((u - u0) / reach_u) ** 2))
    return (np.exp(-(((v - v0) / reach_v) ** 2))[:, None] * across[None]).astype(np.float32)


def _with_noise(image, noise, seed):
    grain = np.random.default_rng(seed).standard_normal(image.shape, dtype=np.float32)
    return np.clip(np.rint(image + np.float32(noise) * grain), 0, 255).astype(np.uint8)
