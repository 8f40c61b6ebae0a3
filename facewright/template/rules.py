"""What a template lacks, made by rule: eyes that turn, a tongue that comes out, even sides, round eyeballs.

Every rule takes arrays and gives new ones; a description file switches it on (docs/template.md).
"""

from __future__ import annotations

import numpy as np

from facewright.conventions import mirrored_name
from facewright.mesh.laplacian import cotangent_laplacian
from facewright.solve.quadratic import Factorization
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


def tongue_out(vertices, faces, border, jaw, tip_target, *, thin=0.3):
    """Displacements (k, 3) that bring a tongue out over the lower teeth and lip.

    vertices (k, 3) mm and faces of the tongue alone; border (b,) indices where it joins the gums
    jaw        (k, 3) what the opening jaw does to the tongue; the border and the root follow it
    tip_target (3,) where the tip comes to lie; the body rises faster than it advances, to clear the teeth
    thin       share of its thickness that the tip loses
    """
    y, z = vertices[:, 1], vertices[:, 2]
    root, tip = z.min(), z.max()
    share = _held_share(vertices, faces, border, (z - root) / (tip - root))
    rise = 1.0 - (1.0 - share) ** 2
    body = np.polynomial.Polynomial.fit(z, y, 3)(z)
    front = vertices[z > tip - 0.05 * (tip - root)].mean(axis=0)
    way = np.asarray(tip_target) - front
    forward = np.outer(share, [0.0, 0.0, way[2]])
    upward = np.outer(rise, [0.0, way[1], 0.0])
    upward[:, 1] -= thin * share * (y - body)
    return (1.0 - rise)[:, None] * jaw + forward + upward


def _held_share(vertices, faces, border, t):
    """(k,) 0 at the border and near the root, 1 at the tip: harmonic between, so that the surface stretches evenly."""
    L = cotangent_laplacian(vertices, faces)
    held = np.zeros(len(vertices), bool)
    held[border] = True
    held |= t < 0.08
    front = (t > 0.93) & ~held
    fixed = held | front
    value = np.where(front, 1.0, 0.0)
    inner, outer = np.flatnonzero(~fixed), np.flatnonzero(fixed)
    value[inner] = Factorization(L[inner][:, inner]).solve(-(L[inner][:, outer] @ value[outer]))
    return np.clip(value, 0.0, 1.0)


def even_eyes(modes, vertices, center):
    """Identity modes (i, k, 3) of an eyeball replaced by their best move and even scale, so it stays a sphere."""
    offset = vertices - center
    move = modes.mean(axis=1, keepdims=True)
    mean_offset = offset.mean(axis=0)
    spread = offset - mean_offset
    grow = np.einsum("ikc,kc->i", modes - move, spread) / np.einsum("kc,kc->", spread, spread)
    return move + grow[:, None, None] * spread
