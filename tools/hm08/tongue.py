"""A tongue by rule: sections along a spine, at rest behind the lower teeth and out between the lips."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from hm08.neutral import symmetric

COLUMNS = 20
ROWS = 26
OUT_JAW = 0.38  # of jawOpen: tongueOut parts teeth and lips by itself, else the tongue would go through them
TIP = 0.86  # share of the length where the sides begin to close
GROOVE_MM, GROOVE_WIDTH_MM = 0.9, 3.0
# Share of the length from the root; z, y of the spine, half thickness, half width, all mm.
REST = (
    (0.00, -50.0, -85.0, 7.5, 14.0),
    (0.20, -43.0, -77.0, 8.0, 16.5),
    (0.45, -25.0, -72.3, 7.0, 17.0),
    (0.68, -7.0, -73.8, 5.4, 15.0),
    (0.85, 3.5, -76.0, 4.2, 11.5),
    (1.00, 11.6, -77.4, 2.8, 9.0),
)
OUT = (
    (0.00, -50.0, -85.0, 7.5, 14.0),
    (0.20, -43.0, -75.5, 8.0, 16.5),
    (0.36, -28.0, -67.6, 7.2, 16.5),
    (0.52, -8.0, -64.2, 5.4, 14.5),
    (0.66, 11.0, -64.8, 4.2, 12.6),
    (0.80, 28.0, -65.3, 3.8, 12.6),
    (0.91, 40.0, -68.8, 3.5, 12.2),
    (1.00, 49.0, -75.0, 2.8, 11.0),
)
CHANNEL = 0.010  # 1/mm: how much the sides stand above the middle of a tongue that is out


def tongue():
    """vertices (n, 3), polygons (p, 4), uv (t, 2), uv_polygons, mirror (n,), and the same vertices out (n, 3).

    uv: u once around, 0.5 the middle of the upper side, v from the root to the tip. Out is meant for a closed jaw: the
    jaw's own motion comes on top.
    """
    at = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    after = np.roll(at, -1, axis=1)
    tip = ROWS * COLUMNS
    bands = np.stack([after[:-1], at[:-1], at[1:], after[1:]], axis=2).reshape(-1, 4)
    fan = np.stack([after[-1], at[-1], np.full(COLUMNS, tip), np.full(COLUMNS, -1)], axis=1)
    n = COLUMNS + 1
    place = (np.arange(COLUMNS) + COLUMNS // 2) % COLUMNS  # columns start on top, u starts beneath
    v = np.linspace(0.01, 0.97, ROWS)
    grid = np.stack(np.meshgrid(0.01 + 0.98 * np.arange(n) / COLUMNS, v), axis=2).reshape(-1, 2)
    fan_u = 0.01 + 0.98 * (np.arange(COLUMNS) + 0.5) / COLUMNS
    uv = np.concatenate([grid, np.stack([fan_u, np.full(COLUMNS, 0.99)], axis=1)])
    corner = np.arange(ROWS * n).reshape(ROWS, n)
    here, there = corner[:, place], corner[:, place + 1]
    uv_bands = np.stack([there[:-1], here[:-1], here[1:], there[1:]], axis=2).reshape(-1, 4)
    uv_fan = np.stack([there[-1], here[-1], ROWS * n + place, np.full(COLUMNS, -1)], axis=1)
    mirror = np.append(at[:, (-np.arange(COLUMNS)) % COLUMNS].ravel(), tip)
    polygons, uv_polygons = np.concatenate([bands, fan]), np.concatenate([uv_bands, uv_fan])
    rest, out = (symmetric(_body(*profile), mirror) for profile in ((REST, 0.0), (OUT, CHANNEL)))
    return rest, polygons, uv, uv_polygons, mirror, out


def _body(profile, channel):
    """(n, 3) sections along a spine, from the root to the tip, columns from the top to the person's left and round."""
    table = np.array(profile)
    share = 1 - (1 - np.linspace(0, 1, ROWS)) ** 1.5  # closer rows towards the tip
    values = PchipInterpolator(table[:, 0], table[:, 1:])
    z, y, thick, wide = values(share).T
    along = values.derivative()(share)[:, :2]  # z, y
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    phi = 2 * np.pi * np.arange(COLUMNS) / COLUMNS
    sin, cos = np.sin(phi), np.cos(phi)
    # The last rows close like a spoon's edge.
    end = np.sqrt(np.maximum(1 - np.clip((share - TIP) / (1 - TIP), 0, 1) ** 3, 0.02))
    x = np.outer(wide * end, np.sign(sin) * np.abs(sin) ** 0.8)
    height = np.outer(thick * np.maximum(end, 0.5), np.sign(cos) * np.abs(cos) ** 0.9)
    height[:, cos < 0] *= 0.9
    groove = GROOVE_MM * np.exp(-((x / GROOVE_WIDTH_MM) ** 2)) * np.sin(np.pi * np.clip(share, 0, 1))[:, None]
    height -= groove * (cos > 0.2)
    height += channel * x**2
    up = np.stack([-along[:, 1], along[:, 0]], axis=1)  # z, y of the section's upward direction
    points = np.stack([x, y[:, None] + height * up[:, 1:], z[:, None] + height * up[:, :1]], axis=2)
    tip = [0.0, y[-1] + 0.2 * along[-1, 1], z[-1] + 0.2 * along[-1, 0]]
    return np.concatenate([points.reshape(-1, 3), [tip]])
