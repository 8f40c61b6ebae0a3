"""The borders of open eyes, found on a scan's own colours: where skin ends and white, iris or lashes begin.

A landmarker knows what eyes look like. On photographs of 20 people its lids lie on the borders, to the eye within half
a millimetre; where an eye is unlike those it learnt from (made heads, retouched textures) it draws a wide one narrower
by up to 3 mm. It does say which pixels are likely eye and which skin. Of both the colours are counted, every pixel near
the eye is given the odds of being eye, and each border is the path that parts the two best (dynamic programming); the
landmarks move by what they are off beyond their own error, and where colours say little they stay.

Lashes and shadow are as dark as a pupil. What keeps them out is that skin is counted from right beside the landmarks
on: there they take their share of it, and their odds are even. Counted from 2.5 mm on, the upper border of the
photographed eyes moved by 0.8 mm on average, from 0.8 mm on by 0.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, gaussian_filter1d, map_coordinates

from facewright.mesh.raster import RayScene
from facewright.register.colors import surface_colors
from facewright.register.lines import CreaseOptions, best_path, line_frame
from facewright.register.pairs import LIDS

FORWARD = np.array([0.0, 0.0, 1.0])
STEP_MM, MARGIN_MM, FROM_MM = 0.15, 9.0, 60.0
# Likely eye is what lies this deep inside the contour, likely skin what lies this far outside.
EYE_MM, SKIN_MM = 0.8, (0.8, 7.0)
LEAST_PIXELS = 100
# Levels of brightness and of two differences of colour; a colour this rare was not seen; log odds that say nothing, and
# the most they say.
LEVELS, RARE, EVEN, SURE = 24, 2e-5, 1.5, 3.0
# The colours of an eye that the landmarks draw too narrow are counted as skin's until the first rounds have widened
# it: a real one whose upper lid they had 3.5 mm too low was still 2 mm too narrow after two rounds, 0.6 after four. On
# heads of known truth (0.36 mm off) and menpo-james both come to the same.
ROUNDS = 4
SEARCH = CreaseOptions(step_mm=STEP_MM, half_band_mm=5.0, prior_sigma_mm=2.5, bend_weight=0.6)
# A path that gains less by so much than the best one of its column counts as nothing (log odds times mm).
GAIN, SMOOTH_MM = 2.0, 1.0
LANDMARK_ERROR_MM = 0.3
CANTHUS_SIGMA_MM, CANTHUS_REACH_MM = 2.0, 5.0
# Borders are told where the eye opens by this share of its most, and only of eyes that open (mm).
OPEN_SHARE, OPEN_MM = 0.4, 3.0
BESIDE_MM, TOLD_APART = (0.5, 2.5), 0.5


@dataclass(frozen=True)
class EyePicture:
    """An eye seen from in front: x (w,) and y (h,) mm in steps of STEP_MM, colors (h, w, 3) sRGB 0..1, nan for none."""

    x: np.ndarray
    y: np.ndarray
    colors: np.ndarray


@dataclass(frozen=True)
class Border:
    """The border of a lid on the scan: points (k, 3) from the person's right to left; forward (3,) to the viewer.

    ends: which vertices of the template's margin lie beyond the border, at the corners, as places (e,) along it, and
    where they belong across the view (e, 3); None where that is not known
    """

    points: np.ndarray
    forward: np.ndarray
    ends: tuple[np.ndarray, np.ndarray] | None = None


def open_eyes(scan, pairs, closed):
    """dict side -> (upper, lower) Border of the eyes that are open and whose borders the scan's colours show.

    pairs pairs.Pairs; closed dict side -> bool. What a person placed is not asked of the colours again.
    """
    colors = surface_colors(scan)
    index = {name: i for i, name in enumerate(pairs.names)}
    rays, found = RayScene(scan.vertices, scan.faces), {}
    for side, lids in LIDS.items() if colors is not None else ():
        names = [[f"mp{number}" for number in numbers] for numbers in lids]
        if closed[side] or not all(name in index and not pairs.by_hand[index[name]] for name in names[0] + names[1]):
            continue
        upper, lower = (pairs.points[[index[name] for name in lid]][:: 1 if side == "left" else -1] for lid in names)
        borders = lid_borders(rays, colors, upper, lower)
        if borders is not None:
            found[side] = borders
    return found


def lid_borders(rays, colors, upper, lower):
    """(upper Border, lower Border) of an open eye, its corners apart, or None.

    rays: the scan's raster.RayScene; colors: function (faces (k,), barycentric (k, 3)) -> (k, 3) sRGB 0..1
    upper, lower (k, 3) landmarks of both lids from the person's right to left, which share their ends
    """
    R = line_frame(upper, FORWARD)
    center = (upper[0] + upper[-1]) / 2
    flat = [((points - center) @ R.T)[:, :2] for points in (upper, lower)]
    lowest, highest = np.vstack(flat).min(axis=0) - MARGIN_MM, np.vstack(flat).max(axis=0) + MARGIN_MM
    x, y = (np.arange(first, last, STEP_MM) for first, last in zip(lowest, highest))
    across, up = (axis.ravel() for axis in np.meshgrid(x, y))
    origins = np.column_stack([across, up, np.full(len(up), FROM_MM)]) @ R + center
    hits = rays.cast(origins, np.broadcast_to(-R[2], origins.shape))
    hit = hits.face >= 0
    seen = np.full((len(hit), 3), np.nan)
    seen[hit] = colors(hits.face[hit], hits.barycentric[hit])
    borders = trace_borders(EyePicture(x, y, seen.reshape(len(y), len(x), 3)), *flat)
    if borders is None:
        return None
    depth = np.where(hit, FROM_MM - hits.distance, np.nan)
    depth = np.where(hit, depth, np.nanmedian(depth)).reshape(len(y), len(x))
    lifted = []
    for points in borders:
        at = (points - [x[0], y[0]]).T / STEP_MM
        z = map_coordinates(depth, at[::-1], order=1, mode="nearest")
        lifted.append(Border(np.column_stack([points, z]) @ R + center, R[2]))
    return tuple(lifted)


def trace_borders(picture, upper, lower):
    """Upper (k, 2) and lower border (k, 2) of an eye, or None where its colours do not tell it from the skin around it.

    picture EyePicture; upper, lower (l, 2) landmarks of both lids by rising x, which share their first and last point
    """
    x, y = picture.x, picture.y[:, None]
    drawn = [np.interp(x, *points.T) for points in (upper, lower)]
    corners = upper[[0, -1], 0]
    high, low = drawn
    within = (x > corners[0]) & (x < corners[1])
    landmarked = inside = (y < high) & (y > low) & within
    for _ in range(ROUNDS):
        odds = _odds(picture.colors, landmarked & inside, landmarked | inside)
        if odds is None:
            return None
        middle = (high + low) / 2
        high, low = (_parting(odds, picture, middle, line, sign) for line, sign in zip(drawn, (1.0, -1.0)))
        first, last = _ends(odds, picture, high, low, corners)
        within = (x > first) & (x < last)
        inside = (y < high) & (y > low) & within
    opening = np.where(within, high - low, 0.0)
    if opening.max() < OPEN_MM or not _told_apart(odds, y, high, low, within):
        return None
    open_there = opening > OPEN_SHARE * opening.max()
    return tuple(
        np.stack([x, line + _beyond(found - line, LANDMARK_ERROR_MM)], axis=1)[open_there]
        for line, found in zip(drawn, (high, low))
    )


def _beyond(value, slack):
    """What a value is away from zero beyond a slack."""
    return np.sign(value) * np.maximum(np.abs(value) - slack, 0.0)


def _odds(colors, eye, touched):
    """(h, w) log odds of a pixel to be eye, by how often its colour is seen inside and around; 0 where they are even.

    eye (h, w) bool: what is eye by all that is known; touched (h, w) bool: what may be; None where either is too small
    """
    seen = np.isfinite(colors).all(axis=2)
    deep, away = (distance_transform_edt(mask) * STEP_MM for mask in (eye, ~touched))
    samples = [seen & (deep > EYE_MM), seen & (away > SKIN_MM[0]) & (away < SKIN_MM[1])]
    if min(mask.sum() for mask in samples) < LEAST_PIXELS:
        return None
    smooth = gaussian_filter(np.where(seen[..., None], colors, 0.0), (1, 1, 0))
    red, green, blue = np.moveaxis(smooth, -1, 0)
    # Brightness, and red and yellow against their opposites: white of the eye differs from fair skin by these.
    opponent = np.stack([smooth.mean(axis=2), 0.5 + 2.0 * (red - green), 0.5 + red + green - 2.0 * blue])
    level = np.clip((opponent * LEVELS).astype(int), 0, LEVELS - 1)
    shares = []
    for mask in samples:
        count = np.zeros((LEVELS,) * 3)
        np.add.at(count, tuple(level[:, mask]), 1.0)
        shares.append(gaussian_filter(count, 1.0)[tuple(level)] / mask.sum())
    odds = np.clip(np.log((shares[0] + RARE) / (shares[1] + RARE)), -SURE, SURE)
    return np.where(seen, _beyond(odds, EVEN), 0.0)


def _along_columns(odds, picture, heights):
    """(w, k) odds at heights (w, k) mm of each column of the picture; 0 outside."""
    rows = (heights - picture.y[0]) / STEP_MM
    columns = np.broadcast_to(np.arange(len(rows))[:, None], rows.shape)
    return map_coordinates(odds, [rows, columns], order=1, mode="constant", cval=0.0)


def _parting(odds, picture, middle, drawn, sign):
    """(w,) height of the path that parts eye from skin best, above (sign 1) or below (-1) the middle (w,).

    It is looked for around the landmarks' line drawn (w,).
    """
    offsets = np.arange(-SEARCH.half_band_mm, SEARCH.half_band_mm + 1e-9, STEP_MM)
    away = np.maximum(sign * (drawn - middle), 0.0)[:, None] + offsets  # (w, o) from the middle
    steps = np.arange(0.0, away.max() + STEP_MM, STEP_MM)
    gained = np.cumsum(_along_columns(odds, picture, middle[:, None] + sign * steps), axis=1) * STEP_MM
    at = np.clip(np.rint(away / STEP_MM).astype(int), 0, len(steps) - 1)
    gained = np.take_along_axis(gained, at, axis=1)
    strength = np.maximum(GAIN + gained - gained.max(axis=1, keepdims=True), 0.0)
    path = best_path(np.where(away >= 0, strength, 0.0), offsets, SEARCH)
    found = np.maximum(away[np.arange(len(away)), path], 0.0)
    return middle + sign * gaussian_filter1d(found, SMOOTH_MM / STEP_MM, mode="nearest")


def _ends(odds, picture, high, low, corners):
    """x of both ends: how far eye goes on along the opening, near the landmarks' corners (2,)."""
    middle, half = (high + low) / 2, np.maximum((high - low) / 2, 0.3)
    evidence = _along_columns(odds, picture, middle[:, None] + half[:, None] * np.linspace(-0.7, 0.7, 9)).mean(axis=1)
    ends = []
    for corner, outward in zip(corners, (-1, 1)):
        near = np.flatnonzero(np.abs(picture.x - corner) < CANTHUS_REACH_MM)[::outward]
        away = (picture.x[near] - corner) / CANTHUS_SIGMA_MM
        ends.append(picture.x[near[(np.cumsum(evidence[near]) * STEP_MM - 0.5 * away**2).argmax()]])
    return ends


def _told_apart(odds, y, high, low, within):
    """Whether the odds speak on both sides of both borders."""
    near, far = BESIDE_MM
    inside = (y < high - near) & (y > low + near) & within
    above, below = (y > high + near) & (y < high + far), (y < low - near) & (y > low - far)
    around = (above | below) & within
    return bool(inside.any() and odds[inside].mean() > TOLD_APART and odds[around].mean() < -TOLD_APART)
