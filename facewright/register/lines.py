"""Feature lines found on the scan itself: the crease between the lips, and between closed lids.

A crease is a valley of the depth seen from in front. Its strength is the second difference of depth across the line
at several widths; the darkness of the texture helps where the valley is shallow. The line is the path of greatest
strength through a band around the model's line (dynamic programming), so that one weak column cannot derail it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_opening, gaussian_filter1d, median_filter

from facewright.mesh.polyline import arc_lengths
from facewright.mesh.raster import RayScene

# A valley this deep is plain in clay; a line this much darker than its sides is plain in a photograph. In a shallow
# valley the photograph decides, in a deep one the shape does.
DEEP_MM, DARK = 0.6, 0.06
WEAK_MM = 2.0
# Where lips meet, one overhangs the other, and the middle of the wide valley lies up to 0.5 mm beside the line itself.
# A narrow valley this deep (mm: from here on believed, and wholly) says where that is.
SLIT_MM = (0.5, 1.0)
# A crease that a scanner has filled has a flat bottom, and either edge of it is a narrow valley: the path would change
# from one to the other. There the middle of the wide valley has less than SHARP of what they have, and is asked for.
FLAT_WIDTH_MM, FLAT_REACH_MM, SHARP, BLUR_MM = 2.2, 1.6, 0.75, 1.0
SLIT_WIDTH_MM, SLIT_REACH_MM, SLIT_STEP_MM, SLIT_SIGMA_MM = 0.6, 1.0, 0.05, 0.6


@dataclass(frozen=True)
class Crease:
    """points (k, 3) on the scan from start to end; strength (k,) mm, how deep it is; forward (3,) towards the viewer.

    found: it stands out from its surroundings
    """

    points: np.ndarray
    strength: np.ndarray
    forward: np.ndarray
    found: bool


@dataclass(frozen=True)
class CreaseOptions:
    """Band and resolution of the search, mm; overshoot: how far beyond both ends of the model's line to look.

    prior_sigma: how far from the model's line a crease may run. 3.5 drew faint corners of a filled mouth to a line that
    was 1 mm off (p95 of its seam 0.75 mm, 0.51 with 6 and with 10); lips of known truth are the same with either.
    """

    half_band_mm: float = 6.0
    step_mm: float = 0.2
    overshoot_mm: float = 4.0
    widths_mm: tuple[float, ...] = (0.6, 1.0, 1.6)
    prior_sigma_mm: float = 6.0
    bend_weight: float = 0.5
    min_strength_mm: float = 0.04


def line_frame(line, forward):
    """(3, 3) rows: along the line from start to end, across it, towards the viewer."""
    along = line[-1] - line[0]
    along = along / np.linalg.norm(along)
    forward = forward - along * (forward @ along)
    forward = forward / np.linalg.norm(forward)
    return np.stack([along, np.cross(forward, along), forward])


def trace_crease(vertices, faces, line, forward, options=None, darkness=None):
    """The crease of a scan near a model's line.

    vertices (n, 3), faces (m, 3): the scan; line (k, 3): the model's line, start to end; forward (3,): towards the
    viewer; darkness: function (faces (r,), barycentric (r, 3)) -> (r,) in 0..1, or None for an untextured scan
    returns Crease, resampled evenly by arc length to 4 points a millimetre; its ends are where the crease ends
    """
    options = options or CreaseOptions()
    R = line_frame(line, forward)
    center = line.mean(axis=0)
    local = (line - center) @ R.T
    columns = np.arange(local[0, 0] - options.overshoot_mm, local[-1, 0] + options.overshoot_mm + 1e-9, options.step_mm)
    order = np.argsort(local[:, 0])
    middle = np.interp(columns, local[order, 0], local[order, 1])
    reach = options.half_band_mm + 2 * max(options.widths_mm)
    offsets = np.arange(-reach, reach + 1e-9, options.step_mm)
    rays = RayScene(vertices, faces)
    depth, dark = _depth_image(rays, R, center, columns, middle, offsets, darkness)
    strength = _valley_strength(depth, offsets, options)
    evidence = np.minimum(strength / DEEP_MM, 2.0) + np.minimum(_dark_strength(dark, options) / DARK, 1.0)
    inside = np.abs(offsets) <= options.half_band_mm
    if _is_flat(depth, offsets, inside, options):
        evidence = gaussian_filter1d(evidence, BLUR_MM / options.step_mm, axis=1)
    path = best_path(evidence[:, inside], offsets[inside], options)
    rows = np.flatnonzero(inside)[path]
    along = np.arange(len(columns))
    path_strength = strength[along, rows]
    trust = np.clip(path_strength / DEEP_MM, 0.05, 1.0)
    height = _smoothed(middle + offsets[rows], trust, options.step_mm)
    height = height + _to_the_slit(rays, R, center, columns, height)
    points_depth = gaussian_filter1d(depth[along, rows], 0.4 / options.step_mm, mode="nearest")
    start, stop = _ends(path_strength, columns, local[0, 0], local[-1, 0], options)
    points = np.stack([columns, height, points_depth], axis=1)[start:stop]
    core = path_strength[start:stop]
    found = bool(len(core) > 8 and np.median(core) > options.min_strength_mm and np.isfinite(points).all())
    if not found:
        return Crease(line, np.zeros(len(line)), R[2], False)
    points, fractions = _resample(points, 0.25)
    strength = np.interp(fractions, np.linspace(0, 1, len(core)), core)
    return Crease(points @ R + center, strength, R[2], True)


def _smoothed(height, trust, step_mm):
    """The path's height along its columns: followed closely where the crease is deep, smoothed where it is faint."""
    width = 0.6 + 2.4 * (1.0 - float(np.clip(np.median(trust), 0.0, 1.0)))
    weights = gaussian_filter1d(trust, width / step_mm, mode="nearest")
    return gaussian_filter1d(height * trust, width / step_mm, mode="nearest") / weights


def _depth_image(rays, R, center, columns, middle, offsets, darkness):
    """(columns, offsets) depth towards the viewer, holes filled from the neighbours, and darkness or None."""
    x = np.repeat(columns, len(offsets))
    y = (middle[:, None] + offsets[None, :]).ravel()
    origins = np.stack([x, y, np.full(len(x), 200.0)], axis=1) @ R + center
    hits = rays.cast(origins, np.broadcast_to(-R[2], origins.shape))
    depth = np.where(hits.face >= 0, 200.0 - hits.distance, np.nan).reshape(len(columns), len(offsets))
    bad = ~np.isfinite(depth)
    fill = np.nanmedian(depth, axis=1, keepdims=True)
    fill = np.where(np.isfinite(fill), fill, np.nanmedian(depth) if np.isfinite(depth).any() else 0.0)
    depth = np.where(bad, fill, depth)
    # A ray that falls through the slit lands deep in the scan's own mouth bag: no skin is that much deeper.
    floor = median_filter(depth, size=(5, 2 * round(3.0 / (offsets[1] - offsets[0])) + 1), mode="nearest")
    depth = np.maximum(depth, floor - 3.0)
    if darkness is None:
        return depth, None
    dark = np.zeros(len(x))
    seen = hits.face >= 0
    dark[seen] = darkness(hits.face[seen], hits.barycentric[seen])
    return depth, dark.reshape(depth.shape)


def _second_difference(image, width, step):
    k = max(1, round(width / step))
    padded = np.pad(image, ((0, 0), (k, k)), mode="edge")
    return padded[:, : -2 * k] + padded[:, 2 * k :] - 2 * image


def _valley_strength(depth, offsets, options):
    """Depth of the valley in mm: half the second difference, smoothed along the line, the mean over the widths."""
    smooth = gaussian_filter1d(depth, 0.3 / options.step_mm, axis=0)
    step = offsets[1] - offsets[0]
    levels = [0.5 * _second_difference(smooth, width, step) for width in options.widths_mm]
    return np.maximum(np.mean(levels, axis=0), 0.0)


def _is_flat(depth, offsets, inside, options):
    """Whether the bottom of the valley is flat: narrow valleys lie beside the middle of the wide one, not in it."""
    smooth = gaussian_filter1d(depth, 0.3 / options.step_mm, axis=0)
    narrow = np.maximum(_second_difference(smooth, min(options.widths_mm), options.step_mm), 0.0)[:, inside]
    wide = np.maximum(_second_difference(smooth, FLAT_WIDTH_MM, options.step_mm), 0.0)[:, inside]
    path = best_path(wide, offsets[inside], options)
    off = np.abs(offsets[inside][None] - offsets[inside][path][:, None])
    at, around = (np.where(off <= reach, narrow, 0.0).max(axis=1) for reach in (1.1 * options.step_mm, FLAT_REACH_MM))
    core = slice(len(path) // 4, -(len(path) // 4))  # lips run into the corners as they like
    return np.median(at[core] / np.maximum(around[core], 1e-9)) < SHARP


def _dark_strength(dark, options):
    if dark is None:
        return 0.0
    smooth = gaussian_filter1d(gaussian_filter1d(dark, 0.6 / options.step_mm, axis=0), 0.3 / options.step_mm, axis=1)
    levels = [-0.5 * _second_difference(smooth, width, options.step_mm) for width in options.widths_mm]
    return np.maximum(np.mean(levels, axis=0), 0.0)


def _to_the_slit(rays, R, center, columns, height):
    """(columns,) how far across the line the bottom of the narrow valley lies from a path at height (columns,), mm."""
    reach = SLIT_REACH_MM + SLIT_WIDTH_MM
    offsets = np.arange(-reach, reach + 1e-9, SLIT_STEP_MM)
    depth, _ = _depth_image(rays, R, center, columns, height, offsets, None)
    per_mm = 1.0 / (columns[1] - columns[0])
    smooth = gaussian_filter1d(gaussian_filter1d(depth, 0.3 * per_mm, axis=0), 1.0, axis=1)
    narrow = 0.5 * _second_difference(smooth, SLIT_WIDTH_MM, SLIT_STEP_MM)
    within = np.abs(offsets) <= SLIT_REACH_MM
    narrow, offsets = narrow[:, within], offsets[within]
    found = np.maximum(narrow.max(axis=1), 0.0)
    prior = 0.5 * (offsets / SLIT_SIGMA_MM) ** 2
    aside = offsets[(narrow / max(np.median(found), 1e-6) - 0.35 * prior).argmax(axis=1)]
    aside *= np.clip((found - SLIT_MM[0]) / (SLIT_MM[1] - SLIT_MM[0]), 0.0, 1.0)
    return gaussian_filter1d(
        median_filter(aside, round(2.0 * per_mm) | 1, mode="nearest"), 0.6 * per_mm, mode="nearest"
    )


def best_path(strength, offsets, options):
    """Row index per column of the strongest smooth path; the prior keeps it near the model's line."""
    scale = max(np.quantile(strength.max(axis=1), 0.5), 1e-6)
    prior = 0.5 * (offsets / options.prior_sigma_mm) ** 2
    gain = np.minimum(strength / scale, 1.5) - 0.35 * prior[None, :]
    reach = 2
    jumps = np.arange(-reach, reach + 1)
    cost = options.bend_weight * np.abs(jumps) * 0.4
    best = gain[0].copy()
    back = np.zeros(strength.shape, np.int64)
    n_rows = len(offsets)
    for column in range(1, len(gain)):
        padded = np.pad(best, reach, constant_values=-np.inf)
        choices = np.stack([padded[reach + j : reach + j + n_rows] for j in jumps]) - cost[:, None]
        pick = choices.argmax(axis=0)
        back[column] = np.clip(np.arange(n_rows) + jumps[pick], 0, n_rows - 1)
        best = choices.max(axis=0) + gain[column]
    path = np.empty(len(gain), np.int64)
    path[-1] = best.argmax()
    for column in range(len(gain) - 1, 0, -1):
        path[column - 1] = back[column, path[column]]
    return path


def _ends(strength, columns, model_start, model_end, options):
    """Column range of the crease: it ends where its strength stays under a quarter of the middle's for WEAK_MM."""
    smooth = gaussian_filter1d(strength, 0.8 / options.step_mm)
    width = model_end - model_start
    core = (columns > model_start + 0.2 * width) & (columns < model_end - 0.2 * width)
    weak = smooth < 0.25 * np.median(smooth[core])
    # A short weak stretch is a blemish of the scan, not the end; what lies past the search's own ends is unknown.
    length = round(WEAK_MM / options.step_mm)
    weak = binary_opening(np.pad(weak, length, constant_values=True), np.ones(length))[length:-length]
    left = np.flatnonzero(weak & (columns < model_start + 0.2 * width))
    right = np.flatnonzero(weak & (columns > model_end - 0.2 * width))
    start = left.max() + 1 if len(left) else 0
    stop = right.min() if len(right) else len(columns)
    return start, stop


def _resample(points, step):
    length = arc_lengths(points)
    count = max(8, round(length[-1] / step))
    fractions = np.linspace(0, 1, count)
    return resample_line(points, fractions, length), fractions


def resample_line(points, fractions, length=None):
    """(k, 3) points of a polyline at fractions (k,) of its arc length."""
    if length is None:
        length = arc_lengths(points)
    at = np.asarray(fractions) * length[-1]
    return np.stack([np.interp(at, length, points[:, axis]) for axis in range(3)], axis=1)


def arc_fractions(points):
    """(k,) arc length from the start as a fraction of the whole."""
    length = arc_lengths(points)
    return length / max(length[-1], 1e-12)
