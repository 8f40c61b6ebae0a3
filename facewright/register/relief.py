"""Lids told from a scan's shape alone: the template's own eyes, from wide open to shut, held against its relief.

A landmarker that sees no iris takes the grey ball between open lids for a shut lid: of 80 open eyes of made and real
heads in clay it drew 17 as if shut, and the lids of others up to 2.4 mm off in height. The shape says more. Between
open lids a ball stands in a moat, shut lids are one bump with a crease low on it. So the template, brought to the scan
by the other landmarks, is given every opening in turn, and of scan and template the depth seen from in front is
compared, without what is broader than an eye. What agrees best says whether the eyes are open, and where the lids are.
Where a scanner has melted lids and ball into one, all openings agree about as well, and nothing is said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import gaussian_filter, map_coordinates

from facewright.mesh.raster import RayScene
from facewright.register.lids import FORWARD, Border
from facewright.transfer.eyeball import carried_eyeball

SIDES = {"left": "Left", "right": "Right"}
STEP_MM, FROM_MM = 0.3, 60.0
# What is looked at: the lids' own box and so much around it across and up; skin (mm from the lids' middle) that can
# come before it.
AROUND_MM, SKIN_MM = (1.0, 3.0), (35.0, 30.0, 60.0)
# Blurs between which relief lies, and the most it counts for, mm. A broad blur of 4: lids 0.54 mm off instead of 0.48;
# a most of 1.5: 0.54 instead of 0.47.
BAND_MM, MOST_MM = (0.5, 3.0), 3.0
# Weights of the blink that are tried, and which of them are open eyes and which shut ones.
OPENINGS = np.round(np.arange(-0.4, 1.01, 0.1), 2)
OPEN, SHUT = OPENINGS < 0.55, OPENINGS > 0.65
# Relief as flat as this says nothing, mm.
LEAST_RELIEF_MM = 0.05
# How far the template's eye may lie beside the scan's (across and up), and what a mm2 of that costs.
ASIDE_MM, COST_PER_MM2 = (1.8, 3.0), 0.002
# A lid's border is looked for again in this strip about it, this far; what its square costs.
STRIP_BAND_MM, STRIP_MOST_MM, STRIP_MM, STRIP_REACH_MM, STRIP_COST = (0.4, 2.5), 1.0, 2.0, 1.5, 0.02
# Then each corner by what is so near, this far across and up; what a mm2 of that costs. Of 35 eyes of made heads the
# template's corners lay 1.17 mm off across the view where the whole eye agrees best, and 0.70 when looked for again;
# what is 4.5 mm near: 0.78.
CORNER_MM, CORNER_REACH_MM, CORNER_COST = 3.0, (2.4, 1.8), 0.02
ENDS = 0.15  # of its width, what is left out at either end
# How well both eyes together and the strip must agree, in sum, to be believed: of 312 lids of made heads, clean, noisy,
# blurred or decimated, 246 were, 0.34 mm off in height, the worst 0.96; with 1.3 for it 258, the worst 13.7.
CLEAR = 1.4


@dataclass(frozen=True)
class LidRelief:
    """What the relief of an eye says.

    openness: how much better an open eye agrees with it than a shut one, as a difference of two correlations
    borders: upper and lower lids.Border of the eye as it agrees best if it is open; None where that is not clear
    """

    openness: float
    borders: tuple[Border | None, Border | None]


def lid_reliefs(scan, template, model):
    """dict side -> LidRelief of a scan in our frame; model: ModelFit that the landmarks other than the lids' led."""
    eyes = {side: _Eye.of(scan, template, model, side) for side in SIDES}
    # Eyes are open as wide as each other, and mirror images: alone, one took the fold under its brow for its lid.
    together = eyes["left"].likeness + eyes["right"].likeness[:, :, ::-1]
    opening, up, across = np.unravel_index(np.where(OPEN[:, None, None], together, -np.inf).argmax(), together.shape)
    asked = CLEAR - together[opening, up, across] / 2
    places = {"left": across, "right": together.shape[2] - 1 - across}
    return {side: LidRelief(eye.openness, eye.borders(opening, up, places[side], asked)) for side, eye in eyes.items()}


@dataclass(frozen=True)
class _Eye:
    """An eye of a scan beside the template's, opened as far as each of OPENINGS (o of them) says.

    seen (h, w) the scan's depth, wanted (o, h, w) the template's; lids: upper and lower margin (o, k, 3) there;
    likeness (o, 2 u + 1, 2 a + 1) how well they agree, the template's moved by up to u steps up and a across
    """

    view: _View
    seen: np.ndarray
    wanted: list[np.ndarray]
    lids: tuple[np.ndarray, np.ndarray]
    likeness: np.ndarray

    @classmethod
    def of(cls, scan, template, model, side):
        """The _Eye of a side; model as for lid_reliefs."""
        lines = [template.lines[f"lid_{which}_{side}"] for which in ("upper", "lower")]
        blink = OPENINGS[:, None, None] * (template.shape(f"eyeBlink{SIDES[side]}") @ np.asarray(model.T)[:3, :3].T)
        rest = model.rest[np.concatenate(lines)]
        view = _View.about(rest)
        skin = template.faces[template.skin.face_slice]
        skin = skin[(np.abs(model.rest[skin].mean(axis=1) - rest.mean(axis=0)) < SKIN_MM).all(axis=1)]
        ball = view.depth_of_ball(carried_eyeball(template, model.rest, side))
        seen = view.depth(scan.vertices, scan.faces)
        wanted = [np.maximum(view.depth(model.rest + moved, skin), ball) for moved in blink]
        lids = tuple(model.rest[line] + blink[:, line] for line in lines)
        return cls(view, seen, wanted, lids, view.compared(seen, wanted, rest))

    @property
    def openness(self):
        """How much better an open eye agrees than a shut one."""
        return float(self.likeness[OPEN].max() - self.likeness[SHUT].max())

    def borders(self, opening, up, across, asked):
        """Upper and lower lids.Border of the scan, by the template's eye at a place of likeness; None if not clear.

        asked: how well a strip about each must agree
        """
        aside = (np.array([across, up]) - np.array(self.likeness.shape[:0:-1]) // 2) * STEP_MM
        return tuple(self.view.border(self.seen, self.wanted[opening], lid[opening], aside, asked) for lid in self.lids)


@dataclass(frozen=True)
class _View:
    """An eye seen from in front, from a height: x (w,) and y (h,) mm in steps of STEP_MM."""

    x: np.ndarray
    y: np.ndarray
    height: float

    @classmethod
    def about(cls, lids):
        """The view of lids (k, 3) and all around that is asked for."""
        reach = np.add(AROUND_MM, ASIDE_MM) + 3 * BAND_MM[1]
        low, high = lids[:, :2].min(axis=0) - reach, lids[:, :2].max(axis=0) + reach
        return cls(*(np.arange(a, b, STEP_MM) for a, b in zip(low, high)), lids[:, 2].max() + FROM_MM)

    def depth(self, vertices, faces):
        """(h, w) mm towards the viewer."""
        across, up = (axis.ravel() for axis in np.meshgrid(self.x, self.y))
        origins = np.column_stack([across, up, np.full(len(up), self.height)])
        hits = RayScene(vertices, faces).cast(origins, np.broadcast_to(-FORWARD, origins.shape))
        depth = np.where(hits.face >= 0, self.height - hits.distance, np.nan)
        filler = np.nanmedian(depth) if (hits.face >= 0).any() else 0.0
        return np.where(hits.face >= 0, depth, filler).reshape(len(self.y), len(self.x))

    def depth_of_ball(self, ball):
        """(h, w) mm towards the viewer of an Eyeball, far behind beside it; without the cornea, which scanners miss."""
        aside = (self.x - ball.center[0]) ** 2 + (self.y[:, None] - ball.center[1]) ** 2
        before = np.sqrt(np.maximum(ball.radius**2 - aside, 0.0))
        return np.where(aside < ball.radius**2, ball.center[2] + before, -np.inf)

    def at(self, points):
        """(2, k) rows and columns of points (k, 2)."""
        return ((points - [self.x[0], self.y[0]]) / STEP_MM).T[::-1]

    def compared(self, seen, wanted, lids):
        """(o, 2 u + 1, 2 a + 1) correlation of images wanted (o of (h, w)), moved up and across, with seen (h, w)."""
        across, up = (round(mm / STEP_MM) for mm in ASIDE_MM)
        low, high = lids[:, :2].min(axis=0) - AROUND_MM, lids[:, :2].max(axis=0) + AROUND_MM
        (bottom, top), (left, right) = self.at(np.stack([low, high])).astype(int)
        relief = _relief(seen, BAND_MM, MOST_MM)[bottom - up : top + up, left - across : right + across]
        windows = sliding_window_view(relief, (top - bottom, right - left))
        models = [_relief(image, BAND_MM, MOST_MM)[bottom:top, left:right] for image in wanted]
        return np.stack(_likeness(windows, models, COST_PER_MM2))

    def border(self, seen, wanted, margin, aside, asked):
        """The Border on the scan of a margin (k, 3) of an image wanted (h, w) that lies aside (2,).

        None if the strips about it agree less than asked, or best where the search ends
        """
        x, height = margin[np.argsort(margin[:, 0]), :2].T
        end = ENDS * np.ptp(x)
        columns = np.arange(x[0] + end, x[-1] - end, STEP_MM)
        height = np.interp(columns, x, height)
        strip = np.arange(-STRIP_MM, STRIP_MM + 1e-9, STEP_MM / 2)
        image, relief = (_relief(depth, STRIP_BAND_MM, STRIP_MOST_MM) for depth in (wanted, seen))

        def along(picture, right, up):
            places = np.stack(np.broadcast_arrays(columns[:, None] + right, height[:, None] + up + strip), axis=-1)
            values = map_coordinates(picture, self.at(places.reshape(-1, 2)), order=1, mode="nearest")
            return (values - values.mean()) / max(values.std(), 1e-6)

        model = along(image, 0.0, 0.0)
        raised = np.arange(-STRIP_REACH_MM, STRIP_REACH_MM + 1e-9, STEP_MM / 2)
        agree = [(along(relief, aside[0], aside[1] + up) * model).mean() - STRIP_COST * up**2 for up in raised]
        best = int(np.argmax(agree))
        if agree[best] < asked or best in (0, len(raised) - 1):
            return None
        points = np.column_stack([columns + aside[0], height + aside[1] + raised[best]])
        z = map_coordinates(seen, self.at(points), order=1, mode="nearest")
        inwards = np.minimum(margin[:, 0] - x[0], x[-1] - margin[:, 0]) / end
        places = np.flatnonzero(inwards < 1.0)
        nearer = np.abs(margin[places, 0, None] - margin[[0, -1], 0]).argmin(axis=1)
        corners = np.stack([self.corner(relief, image, corner, aside) for corner in margin[[0, -1], :2]])
        share = inwards[places, None]
        ends = margin[places]
        ends[:, :2] += (1.0 - share) * corners[nearer] + share * (aside + [0.0, raised[best]])
        return Border(np.column_stack([points, z]), FORWARD, (places, ends))

    def corner(self, relief, image, corner, aside):
        """(2,) mm from a corner (2,) of the template's eye to the scan's, near aside; image, relief (h, w) of both."""
        steps = np.round(np.divide(CORNER_REACH_MM, STEP_MM)).astype(int)
        half = round(CORNER_MM / STEP_MM)

        def around(picture, center, reach):
            up, across = (np.arange(-k, k + 1) * STEP_MM for k in half + reach)
            places = np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2) + center
            values = map_coordinates(picture, self.at(places), order=1, mode="nearest")
            return values.reshape(len(up), len(across))

        model = around(image, corner, np.zeros(2, int))
        windows = sliding_window_view(around(relief, corner + aside, steps[::-1]), model.shape)
        (likeness,) = _likeness(windows, [model], CORNER_COST)
        up, across = np.unravel_index(likeness.argmax(), likeness.shape)
        return aside + (np.array([across, up]) - steps) * STEP_MM


def _likeness(windows, models, cost_per_mm2):
    """For each of models (h, w): its correlations (2 u + 1, 2 a + 1) with windows (2 u + 1, 2 a + 1, h, w).

    Less what it costs that a window lies so many steps up and across of the middle one.
    """
    up, across = ((np.arange(count) - count // 2) * STEP_MM for count in windows.shape[:2])
    cost = cost_per_mm2 * (up[:, None] ** 2 + across**2)
    spread = np.maximum(windows.std(axis=(2, 3)), LEAST_RELIEF_MM)
    result = []
    for model in models:
        flat = (model - model.mean()) / max(model.std(), LEAST_RELIEF_MM)
        result.append(np.einsum("abij,ij->ab", windows, flat) / flat.size / spread - cost)
    return result


def _relief(depth, band_mm, most_mm):
    """(h, w) depth without what is finer or broader than a band of two blurs, and at most so much."""
    fine, broad = (gaussian_filter(depth, mm / STEP_MM) for mm in band_mm)
    return np.clip(fine - broad, -most_mm, most_mm)
