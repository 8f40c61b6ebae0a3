"""Where the picture of a scan is torn: along cuts of its atlas, and in islands that differ from all around them.

A scan whose picture is put together from photographs has a step where another camera begins, and sometimes a few
triangles from another camera than all their neighbours: a patch of a lid that shows the eye. Edges of atlases with
narrow gutters are torn too. They are as sharp as the mesh; what is read on both sides of them is joined smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from facewright.mesh.adjacency import half_edges
from facewright.mesh.normals import face_areas

SMALL_MM2 = 200.0
STEP, STEP_TIMES = 12.0, 2.0  # sRGB; and in times of the usual step at the scan's cuts
SEAM_MM = 0.7  # to each side of a cut with such a step
TEXEL_MM = 0.7
_ALONG = (0.17, 0.5, 0.83)


@dataclass(frozen=True)
class Cuts:
    """Edges of a scan's surface along which its atlas is cut: half edges (k,) here and there that lie on each other,
    as 3 face + corner; turned (k,) bool: they run opposite ways; chart (m,) int of all faces."""

    here: np.ndarray
    there: np.ndarray
    turned: np.ndarray
    chart: np.ndarray


@dataclass(frozen=True)
class Tears:
    """islands (m,) bool faces of small islands that disagree with all around them
    heights (m, 3) mm of faces over their edges i -> i + 1 where the picture is torn there, else 0
    """

    islands: np.ndarray
    heights: np.ndarray

    def beside(self, face, barycentric):
        """(k,) bool: points less than SEAM_MM from a torn edge of their face (k,), barycentric (k, 3)."""
        torn = np.zeros(len(face), bool)
        for edge in range(3):
            height = self.heights[face, edge]
            torn |= (height > 0.0) & (barycentric[:, (edge + 2) % 3] * height < SEAM_MM)
        return torn


def guarded_edges(looks, cuts):
    """(m, 3) bool: the cut edges i -> i + 1 of faces where samples must stay off what lies across, and (k,) the step of
    colour that is left at each of the Cuts.

    In an atlas with gutters, or in a photograph that goes on beyond a cut, what lies across is right, and samples that
    keep off it make a step of their own.
    """
    guarded = np.ones((len(cuts.chart), 3), bool)
    if not len(cuts.here):
        return guarded, np.zeros(0)
    kept, plain = (_along(looks, cuts, guard) for guard in (True, False))
    bleeding = 0.5 * (np.abs(plain[0] - kept[0]) + np.abs(plain[1] - kept[1])).mean(axis=(0, 2))
    steps, bare = _steps(kept), _steps(plain)
    harmless = bare + bleeding < steps
    guarded = looks.seams.copy()
    for side in (cuts.here, cuts.there):
        guarded.ravel()[side[harmless]] = False
    return guarded, np.where(harmless, bare, steps)


def find_tears(scan, cuts, steps):
    """The Tears of a scan whose Cuts have these steps (k,) of colour."""
    islands, heights = np.zeros(len(scan.faces), bool), np.zeros((len(scan.faces), 3))
    if not len(cuts.here):
        return Tears(islands, heights)
    limit = max(STEP, STEP_TIMES * float(np.median(steps)))
    ends = half_edges(scan.faces)[cuts.here]
    length = np.linalg.norm(scan.vertices[ends[:, 0]] - scan.vertices[ends[:, 1]], axis=1)
    areas = face_areas(scan.vertices, scan.faces)
    count = int(cuts.chart.max()) + 1
    total, whole, torn = np.zeros(count), np.zeros(count), steps > limit
    for side in (cuts.here, cuts.there):
        own = cuts.chart[side // 3]
        whole += np.bincount(own, length, count)
        total += np.bincount(own, length * steps, count)
        heights.ravel()[side[torn]] = 2.0 * areas[side[torn] // 3] / np.maximum(length[torn], 1e-9)
    islands = ((np.bincount(cuts.chart, areas, count) < SMALL_MM2) & (total > limit * whole))[cuts.chart]
    return Tears(islands, heights)


def find_cuts(looks):
    """The Cuts of a scan (sample.ScanLooks); none without a texture."""
    scan = looks.scan
    m = len(scan.faces)
    if not scan.has_texture:
        none = np.zeros(0, int)
        return Cuts(none, none, none.astype(bool), np.arange(m))
    here, there, turned = _shared_edges(scan.faces)
    corner = looks.uv_corners[..., 0] + 1j * looks.uv_corners[..., 1]
    uv = half_edges(np.arange(3 * m).reshape(-1, 3))  # as corners of faces
    uv_here, uv_there = corner.ravel()[uv[here]], corner.ravel()[uv[there]]
    joined = (uv_here == np.where(turned[:, None], uv_there[:, ::-1], uv_there)).all(axis=1)
    image = scan.face_texture if scan.face_texture is not None else np.zeros(m, int)
    joined &= image[here // 3] == image[there // 3]
    links = sp.coo_matrix((np.ones(joined.sum()), (here[joined] // 3, there[joined] // 3)), shape=(m, m))
    told = ~joined & (image[here // 3] >= 0) & (image[there // 3] >= 0)
    return Cuts(here[told], there[told], turned[told], connected_components(links, directed=False)[1])


def _shared_edges(faces):
    """Half edges (3 f + i) that lie on each other: (k,), (k,) and (k,) bool: they run opposite ways."""
    edges = half_edges(faces)
    low, high = np.sort(edges, axis=1).T
    keys = low * (int(faces.max()) + 1 if len(faces) else 1) + high
    order = np.argsort(keys, kind="stable")
    pair = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    here, there = order[pair], order[pair + 1]
    return here, there, edges[here, 0] != edges[there, 0]


def _along(looks, cuts, guard):
    """(2, a, k, 3) sRGB along each cut, seen from both sides."""
    result = np.empty((2, len(_ALONG), len(cuts.here), 3), np.float32)
    rows, texel = np.arange(len(cuts.here)), np.full(len(cuts.here), TEXEL_MM)
    for i, share in enumerate(_ALONG):
        for j, (side, at) in enumerate(((cuts.here, share), (cuts.there, np.where(cuts.turned, 1.0 - share, share)))):
            face, corner = np.divmod(side, 3)
            barycentric = np.zeros((len(side), 3), np.float32)
            barycentric[rows, corner], barycentric[rows, (corner + 1) % 3] = 1.0 - at, at
            result[j, i] = looks.colors(face, barycentric, texel, guard)[0]
    return result


def _steps(along):
    """(k,) mean difference of what both sides (2, a, k, 3) show."""
    return np.abs(along[0] - along[1]).mean(axis=(0, 2))
