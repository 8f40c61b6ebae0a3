"""Eyeballs behind the lids, and lids onto the eyeballs.

Eyeballs grow little between people: a 12 mm ball is placed by the lid margins, never stretched with the sockets (which
made it poke through the lids). Then the margins, which no scanner sees well, are laid onto the ball.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from facewright.mesh.polyline import arc_lengths
from facewright.mesh.spread import spread_smoothly
from facewright.transfer.eyeball import angle_from, eye_parts, lid_clearance, measure_eyeball

EYE_RADIUS_MM = 12.0
RADIUS_LIMITS_MM = (11.6, 12.4)  # grown-up eyes hardly differ by more
_RIM_DEG, _DRAWN_IN = 38.0, 0.05
_CORNER_SHARE = 0.15  # of a lid's length at either canthus: caruncle and corner do not lie on the ball


@dataclass(frozen=True)
class LidOptions:
    """gap_mm          distance of the lid margin from the ball at rest
    skin_clear_mm   least distance of the outer lid skin from the ball, reached some way from the margin
    most_mm         how far a margin may be moved to lie on the ball; what is farther is an odd scan, left as it is
    reach_mm        how far a margin's move is felt
    rounds          rounds of pushing out what still lies inside the ball
    most_shift_mm   how far an iris that the scan shows may move the ball sideways and up
    """

    gap_mm: float = 0.22
    skin_clear_mm: float = 0.8
    most_mm: float = 4.0
    reach_mm: float = 6.0
    rounds: int = 4
    most_shift_mm: float = 2.0


def eye_radius(template, vertices, lines):
    """Radius of the person's eyeballs: 12 mm by the distance between the eyes against the template's, 11.6 to 12.4."""
    names = [[f"lid_upper_{side}", f"lid_lower_{side}"] for side in ("left", "right")]
    distance = []
    for V, chains in ((template.vertices, template.lines), (vertices, lines)):
        left, right = (np.concatenate([V[chains[name]] for name in pair]).mean(axis=0) for pair in names)
        distance.append(np.linalg.norm(left - right))
    return float(np.clip(EYE_RADIUS_MM * distance[1] / distance[0], *RADIUS_LIMITS_MM))


def place_eyeball(template, vertices, lines, side, radius, options=None, seen=None):
    """The Eyeball of one side behind a person's lids.

    Sideways and up it stands to the middle of the margins as the template's does; its depth makes the median gap of
    the margins, corners apart, options.gap_mm. vertices (n, 3) of the person, lines as in Face, radius mm
    seen  (2,) x, y of the iris on the scan: the ball moves so that its own lies there, most_shift_mm at most: what is
          more is a look to the side
    """
    options = options or LidOptions()
    own = measure_eyeball(template, side)
    scale = radius / own.radius
    there, _ = _margin(template.vertices, template.lines, side)
    margin, inner = _margin(vertices, lines, side)
    center = margin.mean(axis=0) + scale * (own.center - there.mean(axis=0))
    if seen is not None:
        pupil = center + radius * own.axis
        center[:2] += np.clip(seen - pupil[:2], -options.most_shift_mm, options.most_shift_mm)
    ball = replace(own, center=center, radius=radius, surface=own.surface.scaled(scale))
    depth = _depths(ball, margin[inner], options.gap_mm)
    return replace(ball, center=center + [0.0, 0.0, np.median(depth)])


def moved_to(template, side, ball):
    """part name -> vertices (k, 3) of an eye's parts, brought to a ball by shift and scale: it looks straight ahead.

    What a separate iris has beyond its rim is drawn in a little, else it would show through the white in places.
    """
    own = measure_eyeball(template, side)
    scale = ball.radius / own.radius
    placed = {}
    for part in eye_parts(template, side):
        offset = (template.vertices[part.vertex_slice] - own.center) * scale
        if part.name.startswith("iris"):
            beyond = np.clip((np.degrees(angle_from(own.axis, offset)) - _RIM_DEG) / 15.0, 0.0, 1.0)
            offset = offset * (1.0 - _DRAWN_IN * beyond)[:, None]
        placed[part.name] = ball.center + offset
    return placed


def _margin(vertices, lines, side):
    """(k, 3) points of both margins and (k,) bool: away from the corners."""
    points, inner = [], []
    for lid in ("upper", "lower"):
        chain = vertices[lines[f"lid_{lid}_{side}"]]
        points.append(chain)
        inner.append(_along(chain))
    share = np.concatenate(inner)
    return np.concatenate(points), (share > _CORNER_SHARE) & (share < 1 - _CORNER_SHARE)


def _along(chain):
    """(k,) arc length from 0 to 1 along points (k, 3)."""
    steps = arc_lengths(chain)
    return steps / max(steps[-1], 1e-12)


def _depths(ball, points, gap):
    """(j,) shifts along Z of the ball that bring points (k, 3) to a gap before it, those j that it can touch if any.

    By bisection, as gaps grow when the ball recedes from where its widest ring passes a point. A point farther aside
    than that ring has no such place.
    """
    aside = np.linalg.norm((points - ball.center)[:, :2], axis=1)
    points = points[aside < ball.radius] if (aside < ball.radius).any() else points
    near = points[:, 2] - ball.center[2]
    far = near - 3 * ball.radius
    for _ in range(40):
        middle = 0.5 * (near + far)
        moved = points - np.stack([np.zeros_like(middle), np.zeros_like(middle), middle], axis=1)
        too_close = ball.gap(moved) < gap
        near, far = np.where(too_close, middle, near), np.where(too_close, far, middle)
    return 0.5 * (near + far)


def fit_lids(template, vertices, regions, lines, side, ball, options=None):
    """Lids laid onto an eyeball: the margins at options.gap_mm, no skin inside the ball.

    vertices (n, 3); only the skin in regions eyes and socket_<side> moves, smoothly less towards their border.
    returns (n, 3) and dict(margin_moved_mm, deepest_mm): the largest move of a margin, what still lies inside
    """
    options = options or LidOptions()
    part = template.skin
    faces = template.faces[part.face_slice]
    # With their mirror images, so that both eyes are treated alike however their quads are cut.
    faces = np.concatenate([faces, template.mirror[faces][:, [0, 2, 1]]])
    V = vertices[part.vertex_slice]
    rest = template.vertices[part.vertex_slice]
    free = _lid_region(V, regions, part, side, ball)
    outer = (regions["eyes"][part.vertex_slice] & free) & ~regions[f"socket_{side}"][part.vertex_slice]
    handles, targets, held = _margin_targets(V, lines, side, ball, options)
    clearance = np.full(len(V), 0.5 * options.gap_mm)
    clearance[outer] = lid_clearance(V[outer], V[handles], options.gap_mm, options.skin_clear_mm)
    wanted = {int(i): t for i, t in zip(handles, targets)}
    moved = V
    for _ in range(options.rounds):
        index = np.array(sorted(wanted))
        values = np.array([wanted[i] for i in index]) - V[index]
        moved = V + spread_smoothly(rest, faces, index, values, free, options.reach_mm)
        inside = outer & ~held & (ball.gap(moved) < 0.5 * clearance)
        inside[index] = False
        if not inside.any():
            break
        at = np.flatnonzero(inside)
        wanted.update(zip(at.tolist(), ball.pushed_to(moved[at], clearance[at])))
    result = vertices.copy()
    result[part.vertex_slice] = moved
    stats = {
        "margin_moved_mm": float(np.linalg.norm(moved[handles] - V[handles], axis=1).max()),
        "deepest_mm": float(max(0.0, -ball.gap(moved[free & ~held]).min())),
    }
    return result, stats


def _lid_region(V, regions, part, side, ball):
    """(n_skin,) bool: skin of this eye that may move."""
    eyes = regions["eyes"][part.vertex_slice] | regions[f"socket_{side}"][part.vertex_slice]
    return eyes & (np.linalg.norm(V - ball.center, axis=1) < 3.0 * ball.radius)


def _margin_targets(V, lines, side, ball, options):
    """Margin vertices, where they shall lie, and (n_skin,) bool of the corners, which are left to follow."""
    chains = [lines[f"lid_{lid}_{side}"] for lid in ("upper", "lower")]
    held = np.zeros(len(V), bool)
    handles, targets = [], []
    for chain in chains:
        share = _along(V[chain])
        corner = np.minimum(share, 1 - share) < 0.5 * _CORNER_SHARE
        held[chain[corner]] = True
        keep = chain[~corner]
        goal = ball.pushed_to(V[keep], np.full(len(keep), options.gap_mm))
        step = goal - V[keep]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        handles.append(keep)
        targets.append(V[keep] + step * np.minimum(1.0, options.most_mm / np.maximum(length, 1e-12)))
    return np.concatenate(handles), np.concatenate(targets), held
