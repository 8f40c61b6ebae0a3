"""What a template lacks, made by rule: eyes that turn, even sides, round eyeballs.

Every rule takes arrays and gives new ones; a description file switches it on (docs/template.md).
"""

from __future__ import annotations

import numpy as np

from facewright.conventions import mirrored_name
from facewright.template.symmetry import mirrored_field


def symmetric_shapes(names, deltas, mirror):
    """Deltas (s, n, 3) in which each Left is the exact mirror image of its Right, and middle shapes of themselves."""
    index = {name: i for i, name in enumerate(names)}
    twins = [index[mirrored_name(name)] for name in names]
    return 0.5 * (deltas + mirrored_field(deltas[twins], mirror))


def turned(vertices, center, yaw_deg, pitch_deg):
    """Displacements (k, 3) of vertices turned about a centre: yaw > 0 looks to +X, pitch > 0 up."""
    yaw, pitch = np.radians(yaw_deg), np.radians(pitch_deg)
    cy, sy, cp, sp_ = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_x = np.array([[1, 0, 0], [0, cp, sp_], [0, -sp_, cp]])
    return (vertices - center) @ (about_y @ about_x).T + center - vertices


def eye_turns(side, degrees):
    """shape name -> (yaw, pitch) in degrees for the eye of a side; degrees = dict(out, inward, up, down)."""
    outward = 1.0 if side == "Left" else -1.0
    return {
        f"eyeLookOut{side}": (outward * degrees["out"], 0.0),
        f"eyeLookIn{side}": (-outward * degrees["inward"], 0.0),
        f"eyeLookUp{side}": (0.0, degrees["up"]),
        f"eyeLookDown{side}": (0.0, -degrees["down"]),
    }


def even_eyes(modes, vertices, center):
    """Identity modes (i, k, 3) of an eyeball replaced by their best move and even scale, so it stays a sphere."""
    offset = vertices - center
    move = modes.mean(axis=1, keepdims=True)
    mean_offset = offset.mean(axis=0)
    spread = offset - mean_offset
    grow = np.einsum("ikc,kc->i", modes - move, spread) / np.einsum("kc,kc->", spread, spread)
    return move + grow[:, None, None] * spread
