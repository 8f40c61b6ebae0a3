"""Lips that neither pass through each other nor into the teeth, along the whole path of a shape.

Contact is asked twice: a vertex of one lip is in the other if it lies behind the nearest point of that lip and if the
winding number of the skin says that it is in flesh (the first alone finds false depths of many millimetres on open
mouths). Both lips then give way half and half, and the skin around follows smoothly: a soft biharmonic field whose
wishes add up over a few rounds and over all weights at once, so that one delta serves the whole way from 0 to 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import igl
import numpy as np
from scipy.spatial import cKDTree

from facewright.contact.shut import LipSlit
from facewright.contact.watch import Watch
from facewright.mesh.adjacency import border_vertices
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.laplacian import lumped_mass
from facewright.mesh.normals import dot, lengths, max_norms, normalized, vertex_normals
from facewright.mesh.seam import seam_sides
from facewright.mesh.spread import SoftSpread
from facewright.mesh.winding import winding_numbers

_ASIDE_MM = 0.02  # a vertex is asked about this far in front of its own surface, so that this does not count
_MOST_MM = 8.0  # what seems to lie deeper has met the other lip from behind
_PIN = 100.0  # weight of a push against 1 mm2 of bending
_NOTHING_MM = 1e-4
_SLACK_MM = 0.3  # by which a vertex may lie deeper behind the other lip than it can have gone
_TRUSTED_MM = 1.0  # of a clearance: a lip ends, and farther off a vertex gets behind it without passing through it
_STEPS = np.linspace(0.2, 1.0, 5)  # of a way on which teeth are looked for
_LOCAL_MM = (0.8,) * 6  # widths for lips that shall meet
_ALL_ASKED = 3  # of so many rounds the way is asked as a whole in one
_LEAST_SLOPE = 0.1  # of the lips' lines towards each other at a corner: there they are as near as they are to it


@dataclass(frozen=True)
class LipOptions:
    """lip_mm   along the skin from the seam, outwards and inwards: what counts as lip
    near_mm  skin this far from the seam may give way, and says where flesh is
    smooth_mm width over which a push is felt, round by round: deep contact moves a lip as a whole, the rest is local
    gap_mm   between lips that have been pushed apart; rest_mm between their lines at rest, at least
    tie_mm   width of bending up to which the two sides of a lip move as one, tied_mm from the seam on they do not: what
             teeth push there would bulge the skin
    touch_mm contact less deep than this is none
    ajar_mm  a slit that is nowhere so high is left as it is where lips give way to each other
    teeth_mm how deep in a tooth skin may stay that is there at rest
    off_mm   how far before the teeth skin lies that was pushed out: their edges would stand out between its vertices
    weights  of a shape at which its contact is solved
    """

    lip_mm: float = 12.0
    near_mm: float = 20.0
    smooth_mm: tuple[float, ...] = (3.0, 3.0, 2.0, 2.0, 1.5, 1.0) + (0.8,) * 5
    reach_mm: float = 4.0
    tie_mm: float = 1.5
    tied_mm: float = 6.0
    touch_mm: float = 0.15
    gap_mm: float = 0.05
    rest_mm: float = 0.1
    ajar_mm: float = 0.2
    teeth_mm: float = 0.1
    off_mm: float = 0.3
    weights: tuple[float, ...] = (0.2, 0.4, 0.6, 0.8, 1.0)


class _Watches(NamedTuple):
    """What is known of a pose: the lips in each other (two), in each row of teeth."""

    lips: tuple[Watch, Watch]
    teeth: tuple[Watch, ...]


class LipContact:
    """The lips of one head, asked for contact in any pose of it.

    vertices (n, 3) mm the neutral of the whole head; faces (m, 3) of its skin, the same on both sides (even_handed)
    seams    upper and lower line, paired, with shared ends
    outer    (n,) bool: skin that is seen
    teeth    rows_of_teeth of the head
    """

    def __init__(self, vertices, faces, seams, outer, teeth=(), options=None):
        self.options = options or LipOptions()
        self.V = vertices
        seam = np.unique(np.concatenate(seams))
        near = cKDTree(vertices[seam]).query(vertices)[0] < self.options.near_mm
        around = faces[near[faces].any(axis=1)]
        sides = seam_sides(vertices, around, *seams, self.options.lip_mm, split_ends=False)
        self.used, local = np.unique(around, return_inverse=True)
        self.faces = np.ascontiguousarray(local.reshape(-1, 3))
        self.sides = [np.flatnonzero(side[self.used]) for side in sides]
        self.patches = [self.faces[side[self.used][self.faces].all(axis=1)] for side in sides]
        self.rims = [border_vertices(patch, len(self.used)) for patch in self.patches]
        place = np.full(len(vertices), -1)
        place[self.used] = np.arange(len(self.used))
        lines = [place[line] for line in seams]
        self._pairs, self._ends = [line[1:-1] for line in lines], lines[0][[0, -1]]
        self._both = np.concatenate(self.sides)
        self._skins = self._both[outer[self.used[self._both]]]
        self._about_lips = self.faces[np.isin(self.faces, self._both).any(axis=1)]  # what their normals depend on
        self.lips = self.used[self._both]
        # Outer skin may not come to lie in the teeth either: what does is cheek or chin that a tooth would pierce.
        self._guarded = np.union1d(self._both, np.flatnonzero(outer[self.used]))
        self._hidden = ~outer[self.used[self._guarded]]
        rest = np.ascontiguousarray(vertices[self.used])
        tied = cKDTree(vertices[seam]).query(rest)[0] < self.options.tied_mm
        ties = self._ties(rest, outer[self.used], tied)
        self.spread = SoftSpread(rest, self.faces, near[self.used], self.options.reach_mm, ties=ties)
        self.slit = LipSlit(rest, self.faces, self.patches, lines, outer[self.used], near[self.used])
        # The rest of the head closes the patch: its share of the winding number hardly changes with a pose.
        asked = rest + _ASIDE_MM * vertex_normals(rest, self.faces)
        self._beyond = _winding(vertices, faces, asked) - _winding(rest, self.faces, asked)
        self.teeth = teeth
        in_teeth = [row.way_out(rest[self._guarded], vertices[at])[0] for at, row in self.teeth]
        self._in_teeth = [np.minimum(np.linalg.norm(way, axis=1), self.options.teeth_mm) for way in in_teeth]
        lips = [Watch(rest[mine], rest[other]) for mine, other in zip(self.sides, self.sides[::-1])]
        teeth = [Watch(rest[self._guarded], vertices[at]) for at, _ in self.teeth]
        self._at_rest = self._wishes(rest, vertices, _Watches(tuple(lips), tuple(teeth)))[2]

    def _ties(self, rest, outer, tied):
        """Ties of SoftSpread: lining moves with the skin of its lip that it lies behind."""
        mass, found = lumped_mass(rest, self.faces), []
        for side in self.sides:
            lining, skin = side[tied[side] & ~outer[side]], side[outer[side]]
            found.append((lining, skin[cKDTree(rest[skin]).query(rest[lining])[1]]))
        lining, skin = map(np.concatenate, zip(*found))
        return lining, skin, mass[lining] / self.options.tie_mm**4

    def shut(self, motion, weights=None, acts=None, lifted=False):
        """(n, 3) correction of a motion so that no slit is open between the lips where the correction acts most.

        Arguments as of apart. Less than whole a slit opens as the motion does, but a pair's corrective acts as the
        square of that: what shut it half way would be twice too much at the end. lifted as in LipSlit.wishes.
        """
        weight = self._where_it_acts_most(weights, acts)
        skin = (self.V + motion(weight))[self.used]
        return self._of_head(self.slit.shut(skin, lifted) / (acts(weight) if acts else weight))

    def ajar(self, motion, weights=None, acts=None):
        """How far a motion opens a slit between the lips, mm summed over their lines; 0 where it is nowhere as high as
        ajar_mm. Arguments as of shut."""
        skin = (self.V + motion(self._where_it_acts_most(weights, acts)))[self.used]
        heights = self.slit.wishes(skin)[1]
        return float(heights.sum()) if heights.max() >= self.options.ajar_mm else 0.0

    def _where_it_acts_most(self, weights, acts):
        return max(weights or self.options.weights, key=acts or (lambda weight: weight))

    def apart(self, motion, weights=None, acts=None, closed=False, shut=False, spared_mm=0.0):
        """(n, 3) correction of a motion so that lips stay off each other and off the teeth along it.

        motion   function of a weight: displacement (n, 3) of the head from the neutral
        acts     function of a weight: how strongly the correction acts there; default: as the weight
        weights  at which contact is solved; default: options.weights
        closed   the lips shall meet: pairs of the seam stay together while the rest moves apart, locally
        shut     no slit shall open between them where they give way
        spared_mm how deep in a tooth skin may lie that nobody sees, but where the correction acts most

        The way is walked: each round asks one weight more, from where the correction acts least. Asked at its end at
        once, lips that have gone 3 mm through each other part to the wrong side here and there.
        """
        field = np.zeros((len(self.used), 3))
        hold = np.zeros(len(self.used))
        most_weight = self._where_it_acts_most(weights, acts)
        way = sorted(weights or self.options.weights, key=acts or (lambda weight: weight))
        poses = {weight: self.V + motion(weight) for weight in way}
        asked, left, watches, last = way[:1], dict.fromkeys(way, np.inf), {}, self._at_rest
        solved = {}  # the field with which a pose was asked last
        best, of_best = field, {}  # rounds may swing where lips and teeth both push
        for step, width in enumerate((*(_LOCAL_MM if closed else self.options.smooth_mm), None)):
            total, most, met = np.zeros_like(field), np.zeros(len(field)), []
            for weight in asked:
                share = acts(weight) if acts else weight
                skin = poses[weight][self.used] + share * field
                last = watches.get(weight, last)
                spared = 0.0 if weight == most_weight else spared_mm
                wishes, heeded, last = self._wishes(skin, poses[weight], last, spared)
                watches[weight], solved[weight] = last, field
                left[weight] = max(lengths(wishes).max(initial=0.0), self.options.touch_mm)
                if closed:
                    self._add_closing(skin, wishes, heeded)
                if shut and weight == most_weight:
                    self._add_shutting(skin, wishes, heeded)
                size = lengths(wishes) / share
                more = size > most
                total[more], most[more] = wishes[more] / share, size[more]
                hold = np.maximum(hold, heeded)
                if more.any():
                    met.append(weight)
            # Where a field was not asked about it counts with what was found there last.
            found = {weight: left[weight] for weight in asked}
            if field is best:
                of_best = of_best | found
            elif max(left.values()) <= max((left | of_best).values()):
                best, of_best = field, found
            if met and width is not None:
                field = self.spread(field + total, _PIN * hold, width)
            # What was free stays unasked for some rounds, or until the rest is free: most of a path never touches.
            stale = [weight for weight in way[: len(solved) + 1] if solved.get(weight) is not field]
            asked = met if met and len(solved) == len(way) and step % _ALL_ASKED else stale
            if not asked:
                break
        return self._of_head(best)

    def meets_teeth(self, motion, most):
        """Weight in 0..most at which outer skin of the lips first meets the teeth on the straight way of a motion
        (n, 3); most where it does not."""
        before = last = 0.0
        for weight in most * _STEPS:
            pose = self.V + weight * motion
            skin = pose[self.used[self._skins]]
            depth = max((lengths(row.way_out(skin, pose[at])[0]).max() for at, row in self.teeth), default=0.0)
            if depth > self.options.touch_mm:
                return last + (weight - last) * max(self.options.touch_mm - before, 0.0) / (depth - before)
            before, last = depth, weight
        return most

    def lifted(self, motion, forward):
        """(n, 3) correction of a motion (n, 3) that leaves rest_mm between the lines of lips that touch.

        forward  (3,) unit, where the face looks: across it and the line one lip lies over the other
        """
        a, b = self._pairs
        skin = (self.V + motion)[self.used]
        middle = 0.5 * (skin[a] + skin[b])
        up = normalized(np.cross(forward, np.gradient(middle, axis=0)))
        corner = np.linalg.norm(middle[:, None] - skin[self._ends], axis=2).min(axis=1)
        least = np.minimum(self.options.rest_mm, _LEAST_SLOPE * corner)
        short = np.maximum(least - ((skin[a] - skin[b]) * up).sum(axis=1), 0.0)
        wishes, hold = np.zeros_like(skin), np.zeros(len(skin))
        wishes[a], wishes[b] = 0.5 * short[:, None] * up, -0.5 * short[:, None] * up
        hold[a] = hold[b] = 1.0
        return self._of_head(self.spread(wishes, _PIN * hold, _LOCAL_MM[0]))

    def _of_head(self, field):
        """(n, 3) a field of the surroundings of the lips (k, 3) as one of the whole head."""
        result = np.zeros_like(self.V)
        result[self.used] = np.where(max_norms(field)[:, None] < _NOTHING_MM, 0.0, field)
        return result

    def _wishes(self, skin, pose, watches, spared_mm=0.0):
        """Wishes (k, 3) that undo the contact of the skin around the lips (k, 3), teeth in a pose (n, 3) of the head,
        (k,) in 0..1 who wishes, and the _Watches for the next pose; watches: those of an earlier one; spared_mm: deeper
        than else hidden skin may lie in teeth."""
        skin = np.ascontiguousarray(skin)
        wishes, counts, lips = self._lip_wishes(skin, watches.lips)
        guarded, teeth = skin[self._guarded], []
        for (at, row), allowed, watch in zip(self.teeth, self._in_teeth, watches.teeth):
            watch = watch.at(guarded, pose[at])
            due = watch.due()
            way, clearance = row.way_out(guarded[due], pose[at])
            teeth.append(watch.answered(due, clearance))
            depth, allowed = lengths(way), (allowed + spared_mm * self._hidden)[due]
            hit = depth > allowed + self.options.touch_mm
            farther = (depth - allowed)[hit] + self.options.off_mm
            wishes[self._guarded[due[hit]]] = way[hit] * (farther / depth[hit])[:, None]
            counts[self._guarded[due[hit]]] = 1.0
        return wishes, np.minimum(counts, 1.0), _Watches(lips, tuple(teeth))

    def _add_closing(self, skin, wishes, counts):
        """Add, in place, what brings pairs of the seam that have come apart back to a small gap, half and half."""
        a, b = self._pairs
        way = skin[b] - skin[a]
        apart = np.linalg.norm(way, axis=1)
        far = apart > self.options.touch_mm
        push = 0.5 * way[far] * (1 - self.options.gap_mm / apart[far])[:, None]
        wishes[a[far]], wishes[b[far]] = push, -push
        counts[a[far]] = counts[b[far]] = 1.0

    def _add_shutting(self, skin, wishes, counts):
        """Add, in place, what shuts the slit where no lip has met anything else."""
        lift, over = self.slit.wishes(skin)
        if over.max() < self.options.ajar_mm:
            return
        more = (over > 0.0) & (counts == 0.0)
        wishes[more], counts[more] = lift[more], 1.0

    def _lip_wishes(self, skin, watches):
        """The same for lips in each other: half and half; the other lip answers at the corners of its triangle."""
        normals = vertex_normals(skin, self._about_lips)
        *both, watches = zip(*(self._behind(skin, normals, side, watch) for side, watch in enumerate(watches)))
        index, corners, share, way = map(np.concatenate, both)
        inside = self._in_flesh(skin, normals, index)
        index, corners, share, way = index[inside], corners[inside], share[inside], way[inside]
        wishes, counts = np.zeros_like(skin), np.zeros(len(skin))
        at = np.concatenate([index[:, None], corners], axis=1).ravel()
        weight = np.concatenate([np.ones((len(index), 1)), share], axis=1).ravel()
        push = np.repeat(0.5 * way, 4, axis=0) * weight[:, None]
        push.reshape(-1, 4, 3)[:, 1:] *= -1
        np.add.at(wishes, at, push)
        np.add.at(counts, at, weight)
        return wishes / np.maximum(counts, 1.0)[:, None], counts, watches

    def _in_flesh(self, skin, normals, index):
        """(k,) bool of vertices (k,) of the lips: flesh lies in front of them."""
        asked = skin[index] + _ASIDE_MM * normals[index]
        return winding_numbers(skin, self.faces, asked) + self._beyond[index] > 0.5

    def _behind(self, skin, normals, side, watch):
        """Vertices (k,) of a lip that lie behind the other one, with the corners (k, 3) of the triangle next to them,
        their shares of it (k, 3) and the way out (k, 3); and the Watch for the next pose.

        The lining of a lip has the other one's skin before it at a corner, behind which it has always been: what was
        behind and lies deeper than it can have gone since it was asked last has not come through.
        """
        mine, patch, rim = self.sides[side], self.patches[1 - side], self.rims[1 - side]
        points, other = skin[mine], skin[self.sides[1 - side]]
        was_before, watch = watch.clear(), watch.at(points, other)
        due = watch.due()
        if not len(due):
            none = np.zeros((0, 3))
            return due, none.astype(int), none, none, watch
        found = Surface(skin, patch).closest(points[due])
        corners = patch[found.faces]
        normal = interpolate(normals, patch, found.faces, found.barycentric)
        way, depth = found.points - points[due], found.distance
        behind = dot(way, normal) > 0
        through = behind & (was_before[due] | (depth < watch.reach()[due] + _SLACK_MM))
        maybe = through & (depth > self.options.touch_mm) & (depth < _MOST_MM)
        maybe &= ~(rim[corners] & (found.barycentric > 1e-6)).any(axis=1)
        gone = np.where(through, -depth, 0.0)
        watch = watch.answered(due, np.where(behind, gone, np.minimum(depth, _TRUSTED_MM)))
        out = way[maybe] + self.options.gap_mm * normal[maybe]
        return mine[due[maybe]], corners[maybe], found.barycentric[maybe], out, watch


def _winding(vertices, faces, points):
    arrays = (np.ascontiguousarray(a) for a in (vertices, faces, points))
    return np.asarray(igl.fast_winding_number(*arrays)).reshape(-1)
