"""Fine lines across the red of the lips, as they stand when the ring of muscle around the mouth draws together."""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import vertex_normals
from hm08.shapes.lips import CORNER_COLUMN

PERIOD = 8  # columns of the mouth's grid from crest to crest: four vertices
ROWS = (8, 16, 22, 30)  # of the grid: lines begin, are full from and to, and end at these
CORNER = (0.55, 0.9)  # of the way to the corner over which they fade


class LipLines:
    """Where the lines run on a Head: across the lips, along the columns of the mouth's grid."""

    def __init__(self, head):
        table = head.grid["mouth"]
        top = 2 * CORNER_COLUMN
        keys = np.array([(r, c) for r, c in table if ROWS[0] < r < ROWS[3] and 0 <= c <= top])
        row, column = keys.T
        self.vertices = np.array([table[tuple(key)] for key in keys])
        # Columns count from the middle of each lip, so that both have a crest there.
        from_middle = np.minimum(column, top - column)
        wave = np.cos(2 * np.pi * from_middle / PERIOD)
        across = np.minimum((row - ROWS[0]) / (ROWS[1] - ROWS[0]), (ROWS[3] - row) / (ROWS[3] - ROWS[2]))
        along = (CORNER[1] - from_middle / CORNER_COLUMN) / (CORNER[1] - CORNER[0])
        half = np.where(from_middle == 0, 0.5, 1.0)  # the middle is in the mirror image too
        self.height = half * wave * np.clip(across, 0.0, 1.0) * np.clip(along, 0.0, 1.0)

    def __call__(self, V, F, depth_mm):
        """(n, 3) displacement of the left half of a pose V (n, 3): from crest to groove depth_mm along the normals."""
        field = np.zeros_like(V)
        normals = vertex_normals(V, F)[self.vertices]
        field[self.vertices] = 0.5 * depth_mm * self.height[:, None] * normals
        return field
