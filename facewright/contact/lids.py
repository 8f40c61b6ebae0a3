"""Eyelids as shells that turn about the eyeball.

A lid is a thin shell that slides over a ball. Every motion of it is therefore a field of angles about one axis, from
canthus to canthus through the eye's centre (after "Digital Emily"-style rigs; design: the margin's angle is what an
animator means by how far an eye is open). The field has given values on the two margins and fades over the skin around
(biharmonic, mesh.spread); the skin then turns, and is lifted where the cornea stands higher than the lid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from facewright.contact.axes import EyeAxes
from facewright.contact.meeting import Meeting, along_line
from facewright.contact.rims import FirmRims, from_ends
from facewright.mesh.adjacency import unique_edges
from facewright.mesh.fade import smooth_step
from facewright.mesh.folds import laid_flat
from facewright.mesh.normals import normalized
from facewright.mesh.spread import SmoothSpread
from facewright.solve.quadratic import Factorization
from facewright.transfer.eyeball import lid_clearance

_KEPT_SPACING = 0.5  # of neighbouring margin points of closed lids
_CORNER_MM = 6.0  # around a canthus the field is evened out
_SETTLINGS = 3
_ENDS_MM = 4.0  # of the closing line, over which it rises to the canthi
_FAR_MM = 2.0
_LAP_MM, _LAP_ENDS_MM = 0.12, 6.0  # by which the upper margin lies before the lower one when they are shut
_WAVES = 2  # of the closing line between the canthi
_RADIUS_ROUNDS = 8
# Left between two lids of a blink, which must be tight (if there are faults, the next); of lids that a shape moves.
_SHUT_GAPS_MM, _MOVED_GAP_MM = (0.015, 0.02, 0.03), 0.03
_AS_ONE_MM, _ALONE_MM = 2.5, 12.0  # from the closing line: shut lids go as one with another shape, and not at all


@dataclass(frozen=True)
class LidMotionOptions:
    """upper_share   of the way to the closing line that the upper lid goes, the lower goes the rest
    gap_mm        of the margins from the ball when they move
    closed_mm     of shut margins from the ball
    skin_clear_mm of the outer lid skin from the ball
    reach_mm      how far over the skin a margin's turn is felt: 26 would drag the brow, much less leaves an edge
    soft_mm       width over which the lift off the ball sets in
    """

    upper_share: float = 0.8
    gap_mm: float = 0.22
    closed_mm: float = 0.45
    skin_clear_mm: float = 0.6
    reach_mm: float = 10.0
    soft_mm: float = 0.1


class Lids:
    """The two lids of one eye of a head.

    vertices (n, 3) mm the neutral skin; faces (m, 3) of it; upper, lower: ordered margin vertices from one canthus to
    the other; free (n,) bool skin that may move; outer (n,) bool skin that must stay off the ball (all but the socket)
    ball  transfer.eyeball.Eyeball
    """

    def __init__(self, vertices, faces, upper, lower, free, outer, ball, options=None):
        self.V, self.F, self.ball = vertices, faces, ball
        self.options = options or LidMotionOptions()
        self.upper, self.lower = np.asarray(upper), np.asarray(lower)
        self.free = free
        self.axes = EyeAxes.of(vertices[self.upper], vertices[self.lower], ball.center)
        self.axis = self.axes.axis
        self.margin = np.unique(np.concatenate([self.upper, self.lower]))
        self.canthi = np.intersect1d(self.upper, self.lower)
        self.skin = np.flatnonzero(outer & free)
        clear = lid_clearance(
            vertices[self.skin], vertices[self.margin], self.options.gap_mm, self.options.skin_clear_mm
        )
        # Nothing is asked for that the neutral does not have: the corners lie deep and stay so.
        self.clear = np.minimum(clear, np.maximum(ball.gap(vertices[self.skin]), self.options.gap_mm))
        self._corner = np.isin(self.skin, self.canthi)
        self._corners = None
        self._near_faces = faces[free[faces].any(axis=1)]
        self._met = Meeting(vertices, faces, outer, self.upper, self.lower, self.axes)
        self._firm = FirmRims(vertices, self._met.sides, (self.upper, self.lower), ball.center)
        self._spread = SmoothSpread(vertices, faces, self.margin, free, self.options.reach_mm)
        self._ease = free.astype(float)
        self._ease[self.margin] = 0.0

    def angles(self, points):
        """(k,) radians of elevation of points (k, 3) about the axis, 0 straight ahead."""
        return self.axes.angles(points)

    def opening(self, pose):
        """(u,), (l,) radians by which each upper margin point stands above the lower margin and each lower point below
        the upper one, at the same place along the axis, in a pose (n, 3)."""
        at = pose @ self.axis
        theta_u, theta_l = self.angles(pose[self.upper]), self.angles(pose[self.lower])
        below = along_line(at[self.upper], at[self.lower], theta_l)
        above = along_line(at[self.lower], at[self.upper], theta_u)
        return theta_u - below, above - theta_l

    def closing(self, pose, slides):
        """(u,), (l,) radians where each margin point of a pose (n, 3) lies on the closing line, slid along it.

        The line divides the opening by upper_share. It is smooth from canthus to canthus (a few waves over the chord):
        where margins run steeply into a corner a share of their opening would leave a notch there.
        """
        at = pose @ self.axis
        ends = [line[i] for i in (0, -1) for line in (self.upper, self.lower)]
        start, stop = at[ends].min(), at[ends].max()
        theta_ends = self.angles(pose[ends])[np.argsort(at[ends])][[0, -1]]
        theta_u, theta_l = self.angles(pose[self.upper]), self.angles(pose[self.lower])
        places = np.linspace(start, stop, 65)[1:-1]
        above, below = along_line(places, at[self.upper], theta_u), along_line(places, at[self.lower], theta_l)
        share = self.options.upper_share
        u = (places - start) / (stop - start)
        rise = (1.0 - share) * above + share * below - np.interp(u, [0, 1], theta_ends)
        waves = np.arange(1, _WAVES + 1)
        heights = np.linalg.lstsq(np.sin(np.pi * np.outer(u, waves)), rise, rcond=None)[0]

        def line(index, slide):
            v = np.clip((at[index] + slide - start) / (stop - start), 0.0, 1.0)
            return np.interp(v, [0, 1], theta_ends) + np.sin(np.pi * np.outer(v, waves)) @ heights

        return [line(index, slide) for index, slide in zip((self.upper, self.lower), slides)]

    def slides(self, pose):
        """(u,), (l,) mm along the axis that margin points of a pose (n, 3) need when they come to lie in one line.

        A corner of the eye is round: its points stand above each other, and closed they would fall together. From the
        canthus inwards each keeps a share of its distance from the last at rest.
        """
        return [
            self._slides(pose[line], _KEPT_SPACING * np.linalg.norm(np.diff(self.V[line], axis=0), axis=1))
            for line in (self.upper, self.lower)
        ]

    def spacing(self, pose):
        """(u,), (l,) mm along the axis by which crowded margin points of a pose (n, 3) come apart: each keeps a share
        of what it goes on from the last one at rest."""
        result = []
        for line in (self.upper, self.lower):
            at = self.V[line] @ self.axis
            steps = np.diff(at) * np.sign(at[-1] - at[0])
            result.append(self._slides(pose[line], np.minimum(steps, _KEPT_SPACING * steps)))
        return result

    def _slides(self, chain, steps):
        at = chain @ self.axis
        way = np.sign(at[-1] - at[0])
        from_, slid = at * way, at * way  # from the first canthus to the last
        middle = len(at) // 2
        for i in range(1, middle):
            slid[i] = max(from_[i], slid[i - 1] + steps[i - 1])
            slid[-1 - i] = min(from_[-1 - i], slid[-i] - steps[-i])
        return way * (slid - from_)

    def turned(self, pose, upper_turn, lower_turn, ball=None, slides=None, passing_mm=0.0):
        """The pose (n, 3) with its margins turned by (u,), (l,) radians (positive: up), skin with them.

        slides  (u,), (l,) mm that they slide along the axis besides
        passing_mm  as in lifted
        """
        turns = self.field(upper_turn, lower_turn)
        if slides is not None:
            pose = pose + self.field(*slides)[:, None] * self.axis
        return self.lifted(self.axes.turned(pose, turns), ball, passing_mm)

    def field(self, upper, lower):
        """(n,) values given on the margins, 0 at the canthi, spread over the skin around."""
        values = np.zeros(len(self.V))
        values[self.lower] = lower
        values[self.upper] = upper
        values[self.canthi] = 0.0
        # Round a corner the values change sign within a millimetre, where the smooth field swings over.
        return self._evened_corners(self._spread(values[self.margin][:, None])[:, 0])

    def _evened_corners(self, field):
        """The field (n,) made harmonic around the canthi: nowhere more than on the rim of what is around."""
        if self._corners is None:
            away = cKDTree(self.V[self.canthi]).query(self.V, distance_upper_bound=_CORNER_MM)[0]
            inside = np.isfinite(away) & self.free
            inside[self.margin] = False
            edges = unique_edges(self.F[inside[self.F].any(axis=1)])
            weight = 1.0 / np.linalg.norm(self.V[edges[:, 0]] - self.V[edges[:, 1]], axis=1)
            n = len(self.V)
            W = sp.coo_matrix((weight, (edges[:, 0], edges[:, 1])), shape=(n, n)).tocsr()
            rows = (sp.diags(np.asarray((W + W.T).sum(axis=1)).ravel()) - W - W.T)[inside]
            self._corners = inside, Factorization(rows[:, inside]), rows[:, ~inside]
        inside, factor, rest = self._corners
        result = field.copy()
        result[inside] = factor.solve(-(rest @ field[~inside]))
        return result

    def settled(self, pose, ball=None, gap_mm=None):
        """The pose (n, 3) without folded faces: where the corners press skin together it gives way, but not into the
        ball, nor, where the lids are shut, into the other lid, gap_mm off it."""
        for _ in range(_SETTLINGS):
            flat = laid_flat(self.V, pose, self._near_faces, self._ease)
            if flat is pose:
                break
            pose = self.lifted(flat, ball)
            if gap_mm is not None:
                pose = self._met(pose, gap_mm, unfolded=True)
        return pose

    def lifted(self, pose, ball=None, passing_mm=0.0):
        """The pose (n, 3) with its lid skin lifted off the ball where it is nearer than it should be.

        passing_mm  how much higher skin lies that has come far: it passes here on chords, to which the ball bulges
        """
        ball = ball or self.ball
        points = pose[self.skin]
        come = np.linalg.norm(points - self.V[self.skin], axis=1)
        missing = self.clear + passing_mm * np.minimum(come / _FAR_MM, 1.0) - ball.gap(points)
        width = self.options.soft_mm
        lift = 0.5 * (missing + np.sqrt(missing**2 + width**2))
        rest = self.clear - self.ball.gap(self.V[self.skin])
        lift -= 0.5 * (rest + np.sqrt(rest**2 + width**2))
        lift = np.maximum(lift, 0.0)
        lift[self._corner] = 0.0
        lift[come < 1e-3] = 0.0
        result = pose.copy()
        outward = points - ball.center
        result[self.skin] += outward * (lift / np.linalg.norm(outward, axis=1))[:, None]
        return result

    def joined(self, pose, ball=None):
        """The settled pose (n, 3) of closed lids with both margins on one line over the ball, smooth up to the canthi.

        Where the margins lie along the axis and how high they are turned is left; their distance from the centre is the
        ball's and options.closed_mm, and runs to that of the canthi over the last millimetres.
        """
        ball = ball or self.ball
        moves = []
        for line, slide, sign in zip((self.upper, self.lower), self.slides(pose), (0.5, -0.5)):
            along, theta = pose[line] @ self.axis - ball.center @ self.axis + slide, self.angles(pose[line])
            spokes = np.cos(theta)[:, None] * self.axes.forward + np.sin(theta)[:, None] * self.axes.up
            lap = sign * _LAP_MM * from_ends(self.V[line], _LAP_ENDS_MM)
            points, radius = pose[line], np.linalg.norm(pose[line] - ball.center, axis=1)
            for _ in range(_RADIUS_ROUNDS):
                # The radius is asked where the point comes to lie; near a canthus it would swing to and fro.
                wanted = self._closed_radius(points, pose[self.canthi], ball) + lap
                radius = np.maximum(0.5 * (radius + wanted), np.abs(along) + 1e-3)
                points = ball.center + along[:, None] * self.axis + np.sqrt(radius**2 - along**2)[:, None] * spokes
            moves.append(points - pose[line])
        spread = [self.field(*(move[:, c] for move in moves)) for c in range(3)]
        pose = self.lifted(pose + np.stack(spread, axis=1), ball)
        # Round a corner some rims pass through others when their margins carry them, some when these do not.
        joined = self._soundest(
            self.settled(self._met(self._firm(pose, corners), gap), ball, gap)
            for gap in _SHUT_GAPS_MM
            for corners in (True, False)
        )
        return self._met.sealed(joined)

    def _soundest(self, poses):
        """The first of some poses (n, 3) without faults, or that with the fewest: crossings and folded faces."""
        best, fewest = None, np.inf
        for pose in poses:
            faults = self._met.faults(pose)
            if faults < fewest:
                best, fewest = pose, faults
            if not faults:
                break
        return best

    def carried(self, shut, motion, turn, ball=None):
        """The pose (n, 3) of shut lids that another shape moves by motion (n, 3) besides.

        turn  (l,) radians by which the shape turns the lower margin
        What lies near the closing line is turned, shifted and raised as one, by what depends on the place along the
        axis alone: such a map of space lets nothing pass through anything. Farther away the shape's own motion takes
        over. What faces, which are flat, miss of that is mended as in joined.
        """
        ball = ball or self.ball
        away = cKDTree(shut[self.margin]).query(shut, distance_upper_bound=_ALONE_MM)[0]
        share = smooth_step(away, _ALONE_MM, _AS_ONE_MM)[:, None]
        along = shut @ self.axis
        ends = self.lower[[0, -1]]
        turns = self._waved(along, along[self.lower], turn)
        shift = np.stack([along_line(along, along[ends], motion[ends, c]) for c in range(3)], axis=1)
        line = self.axes.turned(shut, turns) + shift
        rises = [
            self._waved(along, along[index], self._closed_radius(line[index], line[self.canthi], ball) - before)
            for index in (self.upper, self.lower)
            for before in [self._closed_radius(shut[index], shut[self.canthi], self.ball)]
        ]
        result = self.axes.turned(shut, share[:, 0] * turns) + share * shift
        outward = result - ball.center
        result += share * np.mean(rises, axis=0)[:, None] * normalized(outward)
        result = self.lifted(result + (1.0 - share) * motion, ball)
        ways = (lambda: result, lambda: self._met(result, _MOVED_GAP_MM, unfolded=True))
        return self._soundest(self.settled(way(), ball, _MOVED_GAP_MM) for way in ways)

    def turn_of(self, shut, motion):
        """(l,) radians at the lower margin by which a motion (n, 3) turns shut lids (n, 3): half way between both."""
        upper, lower = (
            self.angles((shut + motion)[line]) - self.angles(shut[line]) for line in (self.upper, self.lower)
        )
        at = shut @ self.axis
        return 0.5 * (lower + along_line(at[self.lower], at[self.upper], upper))

    def _waved(self, wanted, places, values):
        """(k,) values (m,) at places along the axis, read at wanted as a few waves over the chord, 0 at its ends."""
        start, stop = places.min(), places.max()
        waves = np.pi * np.arange(1, _WAVES + 1)
        share, read = ((np.clip(at, start, stop) - start) / (stop - start) for at in (places, wanted))
        heights = np.linalg.lstsq(np.sin(np.outer(share, waves)), values, rcond=None)[0]
        return np.sin(np.outer(read, waves)) @ heights

    def _closed_radius(self, points, canthi, ball):
        """(k,) distance from the centre that closed margins have at points (k, 3)."""
        radius = ball.surface_radius(points) + self.options.closed_mm
        for canthus in canthi:
            beyond = ball.gap(canthus[None])[0] - self.options.closed_mm
            radius = radius + beyond * smooth_step(1.0 - np.linalg.norm(points - canthus, axis=1) / _ENDS_MM)
        return radius
