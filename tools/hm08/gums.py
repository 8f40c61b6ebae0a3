"""Gums by rule: a band that hugs the necks of a jaw's teeth, scalloped along them, and the palate between."""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import normalized
from hm08.teeth import arch_frames, placed, tooth_section, turned_over

PER_TOOTH = (6, 4)  # columns beside a front and a back tooth
PAPILLA = 0.36  # of a crown's height that the gum reaches down between two teeth
# The band from the fold under the lip over the margin to the inner side: mm towards the root from the margin, mm off
# the tooth, which face of the tooth, and how much of the scallop is left there.
ROWS = (
    (9.5, -0.8, "outer", 0.0),
    (5.0, 0.75, "outer", 0.25),
    (1.9, 0.95, "outer", 0.75),
    (0.5, 0.6, "outer", 1.0),
    (0.0, 0.15, "outer", 1.0),
    (0.9, -0.7, "outer", 1.0),
    (0.9, -0.7, "inner", 1.0),
    (0.0, 0.15, "inner", 1.0),
    (1.0, 0.8, "inner", 0.9),
    (5.5, 1.2, "inner", 0.2),
)
LOWER_SHARE = 0.6  # the lower band is lower: the chin has little flesh before it
VAULT = (0.45, 1.0)  # shares of the way from the inner gum to the midline, upper jaw
VAULT_MM = 9.0
FLOOR = ((12.0, 3.0),)  # lower jaw: a further row down the inner side, mm towards the root and off the teeth


def gum_band(jaw):
    """vertices (n, 3), polygons (p, 4), uv (n, 2), mirror (n,): columns from the right end of the arch to the left.

    uv: u along the arch, v from 1 at the lips' fold over 0.5 at the margin to 0 at the palate or the mouth's floor
    """
    left = _left_columns(jaw)  # (rows, columns, 3) from the midline on
    columns = np.concatenate([left[:, :0:-1] * [-1, 1, 1], left], axis=1)
    columns[:, left.shape[1] - 1, 0] = 0.0
    n_rows, n_columns = columns.shape[:2]
    at = np.arange(n_rows * n_columns).reshape(n_rows, n_columns)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=2).reshape(-1, 4)
    if jaw.up < 0:
        quads = turned_over(quads)
    rows = np.linspace(1.0, 0.0, n_rows)
    uv = np.stack(np.meshgrid(np.linspace(0.01, 0.99, n_columns), 0.01 + 0.98 * rows), axis=2).reshape(-1, 2)
    return columns.reshape(-1, 3), quads, uv, at[:, ::-1].ravel()


def _left_columns(jaw):
    """(rows, columns, 3) of the left half, from the midline to behind the last molar."""
    pieces, short = [], 1.0 if jaw.up > 0 else LOWER_SHARE
    for number, tooth in enumerate(jaw.teeth):
        count = PER_TOOTH[0 if tooth.front else 1]
        steps = np.arange(count + (number == len(jaw.teeth) - 1)) / count
        x = (2 * steps - 1) * tooth.width / 2
        outer = np.stack([_row(jaw, number, x, (row[0] * short, *row[1:])) for row in ROWS])
        pieces.append(outer)
    rows = _smoothed(np.concatenate(pieces, axis=1))
    _, tangents, _ = arch_frames(jaw)
    back = rows[:, -1:] + 5.0 * tangents[-1]  # the gum ends behind the last molar
    rows = np.concatenate([rows, back], axis=1)
    last = rows[-1]
    if jaw.up > 0:
        middle = last * [0, 1, 1]
        height = VAULT_MM * np.clip(last[:, :1] / 16.0, 0.0, 1.0) ** 0.7 * [0, 1, 0]
        extra = [last + share * (middle - last) + np.sin(share * np.pi / 2) * height for share in VAULT]
    else:
        extra = [last + [0, -down, 0] + off * normalized(last * [-1, 0, 0] + [0, 0, -8.0]) for down, off in FLOOR]
    return np.concatenate([rows, np.stack(extra)])


def _row(jaw, number, x, row):
    """(k, 3) points of one row beside one tooth at x (k,) along it."""
    tooth = jaw.teeth[number]
    below, off, face, scallop = row
    between = np.abs(2 * x / tooth.width)
    margin = -PAPILLA * between**3.2 * scallop
    t = np.clip(margin, -1, 0)  # above the neck nothing of the crown is left to hug
    level = tooth.height * (1 + margin) + below
    section = [tooth_section(tooth, -value) for value in t]
    half, outer, inner, power = (np.array(values) for values in zip(*section))
    shape = (1 - np.minimum(np.abs(x / half), 1.0) ** power) ** (1 / power)
    middle, reach = (outer - inner) / 2, (outer + inner) / 2
    # Between two teeth the papilla fills the gap nearly to their faces.
    shape = np.maximum(shape, 0.62 - 0.1 * scallop)
    sign = 1.0 if face == "outer" else -1.0
    z = middle + sign * (reach * shape + off)
    return placed(jaw, number, np.stack([x, level, z], axis=1))


def _smoothed(rows):
    """Rows (r, c, 3) with the jumps from tooth to tooth evened out along the arch; the more, the farther from it."""
    result = rows.copy()
    for number, (below, _, _, scallop) in enumerate(ROWS):
        for _ in range(1 + round(below * 1.5) if scallop < 1 else 1):
            line = result[number]
            before = np.concatenate([line[1:2] * [-1, 1, 1], line[:-1]])
            after = np.concatenate([line[1:], line[-1:]])
            result[number] = 0.5 * line + 0.25 * (before + after)
            result[number, -1] = line[-1]
    result[:, 0, 0] = 0.0
    return result
