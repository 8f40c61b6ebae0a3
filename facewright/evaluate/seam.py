"""Where the lips of a scan meet, found by rolling balls: a check on registration that knows nothing of how it works.

Vertical sections fan out along the mouth. In each the scan's depth seen from outside is closed by a disc (grey closing:
the lowest profile that a rolling disc of that radius can touch). Where the disc bridges, there is a pocket; the deepest
one of a disc as big as a lip is the mouth, and smaller discs rolled inside that pocket narrow it down to the line where
the two lips touch. The sections are seen from the direction in which the big disc rests on both lips, so that an
overhanging upper lip does not hide the line. A scan that is open there (a ray falls through a slit) makes the pocket
deeper and nothing else. Where a coarse scan has only a wide trough, its darkest line in the texture decides, if it has
one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from facewright.mesh.closest import interpolate
from facewright.mesh.raster import RayScene
from facewright.mesh.render import sample_texture

DISCS_MM = (4.0, 1.5, 0.5)
STEP_MM = 0.05
WINDOW_MM = 9.0
FAN_DEG = 35.0
DEPTH_CAP_MM = 3.0
FAINT_MM = 0.08
CLEAR_MM = 0.25
BESIDE = round(0.5 / STEP_MM)


@dataclass(frozen=True)
class Crease:
    """The lips' meeting line, station by station from the person's right corner to the left.

    points (k, 3) mm; strength (k,) depth of the pocket under the big disc, mm; sure (k,) bool
    origins (k, 3), outward (k, 3), up (k, 3), across (k, 3): the sections; across is normal to a section's plane
    """

    points: np.ndarray
    strength: np.ndarray
    sure: np.ndarray
    origins: np.ndarray
    outward: np.ndarray
    up: np.ndarray
    across: np.ndarray


def find_crease(
    vertices, faces, corner_right, corner_left, *, brightness=None, stations=61, margin=0.06, up=(0.0, 1.0, 0.0)
):
    """The Crease of a scan (vertices (n, 3), faces (m, 3)) between two roughly known mouth corners (3,).

    brightness  function (faces (k,), barycentric (k, 3)) -> (k,), asked where the crease is a wide trough; or None
    margin      share of the width that is left out at either corner; up (3,) roughly
    """
    scene = RayScene(vertices, faces)
    sections = _fan(np.asarray(corner_right, float), np.asarray(corner_left, float), np.asarray(up, float))
    origins, outward, upward, across = sections(np.linspace(margin, 1 - margin, stations), np.zeros(stations))
    tilt = np.array([_tilt(_profile(scene, *frame)[0]) for frame in zip(origins, outward, upward)])
    t = np.linspace(-1, 1, stations)
    tilt = np.polyval(np.polyfit(t, median_filter(tilt, 15, mode="nearest"), 2), t)
    origins, outward, upward, across = sections(np.linspace(margin, 1 - margin, stations), tilt)
    found = []
    for frame in zip(origins, outward, upward):
        depth, hits = _profile(scene, *frame)
        light = None if brightness is None else _light(hits, brightness)
        found.append(_locate(depth, light))
    height, depth, strength = np.array(found).T
    smooth = median_filter(height, 9, mode="nearest")
    sure = (strength > FAINT_MM) & (np.abs(height - smooth) < 0.8)
    points = origins + height[:, None] * upward + depth[:, None] * outward
    return Crease(points, strength, sure, origins, outward, upward, across)


def seam_offsets_mm(crease, seam):
    """(k,) distance along each section between the crease and a polyline seam (s, 3); NaN where either is missing.

    Measured up and down the face, as seen from outside: how deep between the lips a seam lies is not its place.
    """
    offsets = np.full(len(crease.points), np.nan)
    for i in np.flatnonzero(crease.sure):
        side = (seam - crease.origins[i]) @ crease.across[i]
        crossing = np.flatnonzero(side[:-1] * side[1:] <= 0)
        if len(crossing):
            j = crossing[0]
            span = side[j] - side[j + 1]
            share = side[j] / span if span else 0.0
            point = seam[j] + share * (seam[j + 1] - seam[j])
            offsets[i] = abs((point - crease.points[i]) @ crease.up[i])
    return offsets


def measure_seam(scan, fit, lines, *, scale=1.0):
    """dict lip_seam_mm (p95), lip_seam_mean_mm, lip_seam_sure (share of sections with a clear crease).

    scan a data.Scan in the fit's frame; fit (n, 3); lines as in Face.lines
    """
    seam = (fit[lines["lip_seam_upper"]] + fit[lines["lip_seam_lower"]]) / 2
    ends = seam[0] * scale, seam[-1] * scale
    crease = find_crease(scan.vertices * scale, scan.faces, *ends, brightness=scan_brightness(scan))
    offsets = seam_offsets_mm(crease, seam * scale)
    known = offsets[np.isfinite(offsets)]
    return {
        "lip_seam_mm": float(np.percentile(known, 95)) if len(known) else None,
        "lip_seam_mean_mm": float(known.mean()) if len(known) else None,
        "lip_seam_sure": float(crease.sure.mean()),
    }


def _fan(right, left, up):
    """A function (t (k,), tilt (k,)) -> origins, outward, upward, across (k, 3) of the sections."""
    chord = (left - right) / np.linalg.norm(left - right)
    up = up - chord * (up @ chord)
    up = up / np.linalg.norm(up)
    forward = np.cross(chord, up)

    def sections(t, tilt):
        yaw = np.radians(FAN_DEG) * (2 * t - 1)
        level = np.sin(yaw)[:, None] * chord + np.cos(yaw)[:, None] * forward
        outward = np.cos(tilt)[:, None] * level + np.sin(tilt)[:, None] * up
        upward = np.cos(tilt)[:, None] * up - np.sin(tilt)[:, None] * level
        return right + t[:, None] * (left - right), outward, upward, np.cross(upward, outward)

    return sections


def _heights():
    return np.arange(-WINDOW_MM, WINDOW_MM + STEP_MM / 2, STEP_MM)


def _profile(scene, origin, outward, up):
    """(h,) how far out the scan is at each height of a section, mm from origin, -inf where there is none; the Hits."""
    starts = origin + _heights()[:, None] * up + 60.0 * outward
    hits = scene.cast(starts, np.broadcast_to(-outward, starts.shape))
    return 60.0 - hits.distance, hits


def _light(hits, brightness):
    """(h,) brightness along a section, smoothed over half a millimetre; 1 where there is no surface."""
    light = np.ones(len(hits.face))
    seen = hits.face >= 0
    light[seen] = brightness(hits.face[seen], hits.barycentric[seen])
    return gaussian_filter1d(light, 0.25 / STEP_MM, mode="nearest")


def scan_brightness(scan):
    """The brightness function of a data.Scan with texture or colours; None for clay."""
    if scan.colors is not None:
        return lambda faces, barycentric: interpolate(scan.colors, scan.faces, faces, barycentric).mean(axis=1)
    if not scan.has_texture:
        return None
    image_of = np.zeros(len(scan.faces), np.int64) if scan.face_texture is None else scan.face_texture

    def brightness(faces, barycentric):
        result = np.ones(len(faces))
        for number, image in enumerate(scan.textures):
            mine = image_of[faces] == number
            uv = interpolate(scan.uv, scan.uv_faces, faces[mine], barycentric[mine])
            result[mine] = sample_texture(image, uv)[:, :3].mean(axis=1) / 255.0
        return result

    return brightness


def _close(depth, radius):
    """Grey closing of a profile (h,) by a disc: what the disc bridges is filled."""
    reach = int(radius / STEP_MM)
    offsets = np.arange(-reach, reach + 1) * STEP_MM
    disc = np.sqrt(np.maximum(radius**2 - offsets**2, 0.0))
    padded = np.pad(depth, 2 * reach, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view
    rolled = (windows(padded, 2 * reach + 1) + disc).max(axis=1)  # centre of the disc on top of the profile
    return (windows(rolled, 2 * reach + 1) - disc).min(axis=1)


def _capped(depth):
    """The profile without slits deeper than the cap, so that a gap weighs no more than a deep crease."""
    finite = np.where(np.isfinite(depth), depth, -1e3)
    return np.maximum(finite, _close(finite, DISCS_MM[0]) - DEPTH_CAP_MM)


def _pocket(depth, closed, first, last):
    """Range (start, stop) of the pocket around the deepest place of closed - depth within first..last."""
    gap = (closed - depth)[first:last]
    deepest = first + int(gap.argmax())
    bridged = closed - depth > 1e-6
    start = deepest
    while start > first and bridged[start - 1]:
        start -= 1
    stop = deepest
    while stop < last - 1 and bridged[stop + 1]:
        stop += 1
    return start, stop + 1


def _tilt(depth):
    """Angle of the direction in which the big disc rests on both lips, radians; within 25 degrees."""
    depth = _capped(depth)
    start, stop = _pocket(depth, _close(depth, DISCS_MM[0]), 0, len(depth))
    start, stop = max(start - 1, 0), min(stop, len(depth) - 1)
    rise = (stop - start) * STEP_MM
    return float(np.clip(np.arctan2(depth[start] - depth[stop], rise), -0.44, 0.44))


def _locate(depth, light=None):
    """height, depth and strength (mm) of the crease in one section.

    A smaller disc has a say only where it finds a pocket of its own: in a wide trough (a coarse scan) its finds are the
    kinks between facets, and the middle of the big disc's pocket, or what is dark there, is the better answer.
    """
    depth = _capped(depth)
    closed = _close(depth, DISCS_MM[0])
    strength = float((closed - depth).max())
    start, stop = _pocket(depth, closed, 0, len(depth))
    trough = True
    for radius in DISCS_MM[1:]:
        finer = _close(depth, radius)
        if (finer - depth)[start:stop].max() < CLEAR_MM:
            break
        closed, trough = finer, False
        start, stop = _pocket(depth, closed, start, stop)
    if trough and light is not None:
        start, stop = max(start - BESIDE, 0), min(stop + BESIDE, len(depth))
    gap = (closed - depth)[start:stop]
    # In a trough the middle of the pocket, in a crease its bottom, not the middle of its slopes.
    weight = gap if trough else np.maximum(gap - 0.7 * gap.max(), 0.0)
    if trough and light is not None:
        shade = light[start:stop]
        weight = np.maximum(shade.min() + 0.2 * (shade.max() - shade.min()) - shade, 0.0)
    middle = start + (weight @ np.arange(stop - start)) / weight.sum() if weight.sum() > 0 else (start + stop - 1) / 2
    rim = (depth[max(start - 1, 0)] + depth[min(stop, len(depth) - 1)]) / 2
    return _heights()[0] + middle * STEP_MM, rim, strength
