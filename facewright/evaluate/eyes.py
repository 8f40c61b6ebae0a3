"""How lids and eyeballs of a rig get on: as a right runtime plays it, and with the plain shapes alone."""

from __future__ import annotations

import numpy as np

from facewright.expand import expand_weights
from facewright.mesh.closest import Surface

CORNER_SHARE = 0.15  # of a margin at either canthus: there lies the caruncle, not the ball
NEAR_MM = 24.0
BLINKS = (0.25, 0.5, 0.75, 1.0)
DEPTH_BAR_MM, GAP_BAR_MM = 0.2, 0.3


def eye_poses():
    """name -> weights of shapes without their side: the poses that lids must survive."""
    poses = {f"eyeBlink {weight:g}": {"eyeBlink": weight} for weight in BLINKS}
    poses |= {f"eyeBlink + {other}": {"eyeBlink": 1.0, other: 1.0} for other in ("eyeLookDown", "eyeSquint")}
    poses |= {
        name: {name: 1.0} for name in ("eyeLookUp", "eyeLookDown", "eyeLookIn", "eyeLookOut", "eyeWide", "eyeSquint")
    }
    for side in ("In", "Out"):
        for way in ("Up", "Down"):
            pair = {f"eyeLook{side}": 1.0, f"eyeLook{way}": 1.0}
            poses[" + ".join(pair)] = pair
    return poses


def measure_eyes(rig):
    """dict: "radius_mm", "lid_gap_mm" and, for each of eye_poses, "depth_mm" and "margins_mm", worse side each.

    depth_mm    of the deepest outer lid vertex inside the eyeball; (with in-betweens and correctives, plain)
    margins_mm  largest distance between the two margins; only where the eye shall be shut; (same, same)
    lid_gap_mm  largest distance of a margin from the ball at rest, the outer 15 % at either canthus left out
    """
    eyes = [_Eye(rig, side) for side in ("left", "right")]
    result = {
        "radius_mm": max((eye.radius for eye in eyes), key=lambda radius: abs(radius - 12.0)),
        "lid_gap_mm": max(eye.lid_gap() for eye in eyes),
        "poses": {},
    }
    for name, weights in eye_poses().items():
        figures = {"depth_mm": [], "margins_mm": []}
        for full in (True, False):
            found = [eye.figures(weights, full) for eye in eyes]
            figures["depth_mm"].append(max(depth for depth, _ in found))
            figures["margins_mm"].append(max(gap for _, gap in found))
        if weights.get("eyeBlink", 0.0) < 1.0:
            del figures["margins_mm"]
        result["poses"][name] = {key: tuple(pair) for key, pair in figures.items()}
    return result


def margin_gap_mm(upper, lower):
    """Largest distance of a point of either polyline (u, 3), (l, 3) from the other one."""
    return max(_to_line(upper, lower).max(), _to_line(lower, upper).max())


def _to_line(points, line):
    start, edge = line[:-1], np.diff(line, axis=0)
    share = ((points[:, None] - start) * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=1), 1e-12)
    foot = start + np.clip(share, 0.0, 1.0)[:, :, None] * edge
    return np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1)


class _Eye:
    """One eye of a rig: its ball's mesh, the lids around it."""

    def __init__(self, rig, side):
        self.rig, self.side = rig, side
        self.skin = rig.meshes[0]
        self.ball = next(mesh for mesh in rig.meshes if mesh.name == f"eye_{side}")
        self.center = rig.skeleton.positions[rig.skeleton.names.index(f"eye_{side}")]
        distance = np.linalg.norm(self.ball.vertices - self.center, axis=1)
        self.radius = float(np.median(distance[self.ball.vertices[:, 2] < self.center[2]]))
        near = np.linalg.norm(self.skin.vertices - self.center, axis=1) < NEAR_MM
        self.lid = np.flatnonzero(near & rig.regions["eyes"] & ~rig.regions[f"socket_{side}"])
        self.upper, self.lower = (np.asarray(rig.lines[f"lid_{lid}_{side}"]) for lid in ("upper", "lower"))

    def lid_gap(self):
        inner = []
        for line in (self.upper, self.lower):
            steps = np.linalg.norm(np.diff(self.skin.vertices[line], axis=0), axis=1)
            share = np.append(0.0, np.cumsum(steps)) / steps.sum()
            inner.append(line[(share > CORNER_SHARE) & (share < 1 - CORNER_SHARE)])
        return float(self._gap(self.skin.vertices[np.concatenate(inner)], self.ball.vertices).max())

    def figures(self, weights, full):
        """depth in mm of the deepest lid point, mm between the margins."""
        weights = {name + self.side.capitalize(): weight for name, weight in weights.items()}
        if full:
            weights = expand_weights(weights, self.rig.in_betweens, self.rig.correctives)
        skin, ball = self._posed(self.skin, weights), self._posed(self.ball, weights)
        depth = max(0.0, -float(self._gap(skin[self.lid], ball).min()))
        return depth, float(margin_gap_mm(skin[self.upper], skin[self.lower]))

    def _posed(self, mesh, weights):
        if mesh.deltas is None:
            return mesh.vertices
        number = self.rig.target_names.index
        return mesh.vertices + sum(weight * mesh.deltas[number(name)] for name, weight in weights.items())

    def _gap(self, points, ball):
        """(k,) signed distance of points from the ball's mesh, negative inside."""
        surface = Surface(ball, self.ball.faces)
        found = surface.closest(points)
        foot = np.linalg.norm(found.points - self.center, axis=1)
        inside = np.linalg.norm(points - self.center, axis=1) < foot
        return np.where(inside, -found.distance, found.distance)
