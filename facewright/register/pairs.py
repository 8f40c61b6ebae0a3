"""Landmarks that scan and template share, and what they tell at once: whether the eyes are shut."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from facewright.scan.landmarks import EYE_LEFT, EYE_RIGHT, LIPS_INNER, LIPS_OUTER, NOSE

PLACED_WEIGHT = 25.0
"""How much more than a found landmark one counts that a person placed."""
# Lids nearer to each other than this share of the rest face's are shut: of colours 0.38 and less, or 0.6 and more.
SHUT_GAP = 0.45
# In clay they say little (shut eyes 0.08 to 0.48, open ones 0.17 to 0.88): what a gap counts for beside the difference
# of two correlations, from which gap on it speaks for an open eye, and when one eye says it all by itself. Of 119 made
# heads in clay, clean, noisy, decimated or blurred, gaps alone read 15 wrong, a weight of 1.75 reads 4, of 0.9 3; of 45
# simulated masks with open, fused eyes 1.75 took 18 for shut, 0.9 takes 5.
GAP_COUNTS, CLAY_GAP, CLEARLY = 0.9, 0.35, 0.3

# Landmarks on the border of the red, corners apart.
BORDERS = {
    "lip_outer_upper": (185, 40, 39, 37, 0, 267, 269, 270, 409),
    "lip_outer_lower": (146, 91, 181, 84, 17, 314, 405, 321, 375),
}

# The upper and the lower lid of each eye, inner to outer canthus.
LIDS = {
    "left": ((362, 398, 384, 385, 386, 387, 388, 466, 263), (362, 382, 381, 380, 374, 373, 390, 249, 263)),
    "right": ((133, 173, 157, 158, 159, 160, 161, 246, 33), (133, 155, 154, 153, 145, 144, 163, 7, 33)),
}


@dataclass(frozen=True)
class Pairs:
    """Landmarks that scan and template share: names (l,), points (l, 3) on the scan, rows (l, n), weights (l,).

    rest (l, 3) the same points on the template's neutral; by_hand (l,) bool: placed by a person
    """

    names: tuple[str, ...]
    points: np.ndarray
    rows: sp.csr_matrix
    weights: np.ndarray
    rest: np.ndarray
    by_hand: np.ndarray

    def without(self, names):
        """All but those of these names, which stay if a person placed them."""
        keep = self.by_hand | ~np.isin(self.names, list(names))
        names = tuple(name for name, kept in zip(self.names, keep) if kept)
        arrays = {name: getattr(self, name)[keep] for name in ("points", "rows", "weights", "rest", "by_hand")}
        return Pairs(names, **arrays)


def landmark_pairs(scan, landmarks, template, placed):
    """The Pairs of a scan's Landmarks and a Template's; placed: names of those that a person placed."""
    on_template = {name: i for i, name in enumerate(template.landmarks.names)}
    led = {f"mp{i}" for i in LIPS_OUTER + LIPS_INNER + EYE_LEFT + EYE_RIGHT + NOSE}
    keep = [
        (i, on_template[name])
        for i, name in enumerate(landmarks.names)
        if name in on_template
        and landmarks.weights[i] > 0
        and (name in led or name in placed)
        and template.landmarks.weights[on_template[name]] > 0
    ]
    on_scan, rows_of = np.array(keep, np.int64).reshape(-1, 2).T
    points = landmarks.positions(scan.vertices, scan.faces)[on_scan]
    marks, faces = template.landmarks, template.faces
    k = len(rows_of)
    columns = faces[marks.faces[rows_of]]
    rows = sp.csr_matrix(
        (marks.barycentric[rows_of].ravel(), (np.repeat(np.arange(k), 3), columns.ravel())),
        shape=(k, len(template.vertices)),
    )
    names = tuple(landmarks.names[i] for i in on_scan)
    if scan.has_texture or scan.colors is not None:
        rows = on_borders(rows, names, template)
    by_hand = np.array([name in placed for name in names], bool)
    weights = np.where(by_hand, PLACED_WEIGHT, landmarks.weights[on_scan])
    return Pairs(names, points, rows, weights, rows @ template.vertices, by_hand)


def on_borders(rows, names, template):
    """Rows (l, n) of landmarks, those of the lips' outline carried to the template's own border of the red.

    In clay the border cannot be seen, and the network puts the upper one 1.5 to 3 mm too low, on templates and scans
    alike, so that the bias cancels; in a photograph it sees the border itself, within 0.5 mm of the hand's.
    """
    V = template.vertices
    rows = rows.tolil(copy=True)
    for line, numbers in BORDERS.items():
        mine = [i for i, name in enumerate(names) if name in {f"mp{number}" for number in numbers}]
        chain = template.lines.get(line)
        if chain is None or not mine:
            continue
        points = rows[mine].tocsr() @ V
        start, step = V[chain[:-1]], np.diff(V[chain], axis=0)
        along = np.einsum("lsc,sc->ls", points[:, None] - start, step) / np.maximum((step**2).sum(axis=1), 1e-12)
        along = np.clip(along, 0.0, 1.0)
        distance = np.linalg.norm(start + along[..., None] * step - points[:, None], axis=2)
        for landmark, segment, share in zip(
            mine, distance.argmin(axis=1), along[np.arange(len(mine)), distance.argmin(axis=1)]
        ):
            rows[landmark] = 0.0
            rows[landmark, chain[segment]] = 1.0 - share
            rows[landmark, chain[segment + 1]] = share
    return rows.tocsr()


def on_lid_borders(pairs, borders):
    """Pairs with the lids' landmarks moved up or down onto borders, dict side -> (upper, lower) lids.Border or None."""
    points = pairs.points.copy()
    index = {name: i for i, name in enumerate(pairs.names)}
    for side, lids in borders.items():
        for border, numbers in zip(lids, LIDS[side]):
            if border is None:
                continue
            x, *rest = border.points.T
            rows = np.array([index[f"mp{number}"] for number in numbers[1:-1] if f"mp{number}" in index], np.int64)
            rows = rows[(points[rows, 0] > x[0]) & (points[rows, 0] < x[-1])]
            for axis, values in zip((1, 2), rest):
                points[rows, axis] = np.interp(points[rows, 0], x, values)
    return replace(pairs, points=points)


def eyes_closed(pairs, openness=None):
    """{"left": bool, "right": bool}: what the lids' landmarks say, in clay with what its relief says.

    openness: dict side -> relief.LidRelief.openness of a scan without colours. There both eyes are judged as one, for a
    neutral face does not wink, unless each is clear by itself.
    """
    gaps = lid_gaps(pairs)
    if openness is None:
        return {side: bool(gap < SHUT_GAP) for side, gap in gaps.items()}
    evidence = {side: openness[side] + GAP_COUNTS * (gaps[side] - CLAY_GAP) for side in gaps if np.isfinite(gaps[side])}
    together = np.mean(list(evidence.values())) if evidence else 0.0
    apart = len(evidence) == len(gaps) and min(map(abs, evidence.values())) > CLEARLY
    return {side: bool((evidence[side] if apart else together) < 0.0) for side in gaps}


def lid_gaps(pairs):
    """dict side -> how far the lids' landmarks are apart for the width of the eye, the rest face's being 1; or nan."""
    index = {name: i for i, name in enumerate(pairs.names)}
    result = {}
    for side, (upper, lower) in LIDS.items():
        if not all(f"mp{number}" in index for number in (upper[0], upper[-1])):
            result[side] = np.nan
            continue
        opposite = [(f"mp{a}", f"mp{b}") for a, b in zip(upper[3:6], lower[3:6])]
        opposite = [(index[a], index[b]) for a, b in opposite if a in index and b in index]
        ratio = []
        for points in (pairs.points, pairs.rest):
            width = np.linalg.norm(points[index[f"mp{upper[0]}"]] - points[index[f"mp{upper[-1]}"]])
            apart = [np.linalg.norm(points[a] - points[b]) for a, b in opposite]
            ratio.append(np.mean(apart) / width if apart else np.nan)
        result[side] = float(ratio[0] / ratio[1])
    return result


def lid_names(side):
    """Names of the landmarks on the upper and on the lower lid of a side, corners apart."""
    return tuple({f"mp{number}" for number in lid[1:-1]} for lid in LIDS[side])


def landmark_errors(pairs, fit):
    """dict mean, p95, max: distance of the fit's (n, 3) landmarks from the scan's, mm."""
    error = np.linalg.norm(pairs.rows @ fit - pairs.points, axis=1)
    return {"mean": float(error.mean()), "p95": float(np.quantile(error, 0.95)), "max": float(error.max())}
