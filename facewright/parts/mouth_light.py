"""The light that comes between the lips, painted onto what lies behind them: few viewers cast such shade.

Teeth, gums and tongue get what light reaches them on average over the poses that show them, seen on the template. So
front teeth stay light, while back teeth, inner sides, necks at the gums and the depth of a mouth go dark, in any
template's own UVs. Tried: no spreading (fissures and gaps of the back teeth look like caries), poses without tongueOut
(then a tongue that is out is dark).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.ndimage import distance_transform_edt
from scipy.sparse.linalg import spsolve

from facewright.mesh.laplacian import clamped_laplacian, lumped_mass
from facewright.mesh.openness import vertex_openness
from facewright.mesh.raster import raster_uv
from facewright.mesh.render import linear_to_srgb, srgb_to_linear

ATTACHED = ("skull", "jaw")
POSES = (
    {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0, "jawOpen": 0.2},
    {"mouthUpperUpLeft": 1.0, "mouthUpperUpRight": 1.0, "mouthLowerDownLeft": 1.0, "mouthLowerDownRight": 1.0},
    {"mouthFunnel": 1.0, "jawOpen": 0.2},
    {"jawOpen": 0.8},
    {"tongueOut": 1.0},
)
FULL = 0.7  # openness that counts as full light: of front teeth between lips that are drawn back
BOUNCE = 0.55  # power: bright teeth and wet walls hand light on
LEAST = 0.1  # share of the light that comes to the darkest place by way of the mouth's walls
WALLS = (0.82, 1.07, 1.16)  # powers of the light: what has come so deep has met red skin before
SOFT_MM = 1.5  # over which light is spread within enamel and gum
_DIRECTIONS = 128


def mouth_light(template):
    """(n,) share of the light for each vertex of a Template: 1 in the open, LEAST where no light comes in any pose.

    cost  one openness of the parts behind the lips a pose, 64 rays a vertex
    """
    behind = np.zeros(len(template.vertices), bool)
    parts = parts_behind_lips(template)
    for part in parts:
        behind[part.vertex_slice] = True
    asked = np.flatnonzero(behind)
    light = np.ones(len(behind))
    if not len(asked):
        return light
    # Whatever else stands in the way of light (lashes, corneas) is far from a mouth.
    faces = np.concatenate([template.faces[p.face_slice] for p in (template.skin, *parts)])
    shapes = dict(zip(template.shape_names, template.deltas))
    found = []
    for pose in POSES:
        moved = template.vertices + sum(weight * shapes[name] for name, weight in pose.items() if name in shapes)
        found.append(vertex_openness(moved, faces, n_directions=_DIRECTIONS, subset=asked))
    # A pose counts by the light that it lets in: what is dark in it is hardly seen in it.
    openness = np.square(found).sum(axis=0) / np.maximum(np.sum(found, axis=0), 1e-9)
    comes = np.minimum(openness / FULL, 1.0) ** BOUNCE
    own = np.searchsorted(asked, np.concatenate([template.faces[part.face_slice] for part in parts]))
    light[asked] = LEAST + (1.0 - LEAST) * _spread(comes, template.vertices[asked], own)
    return 0.5 * (light + light[template.mirror])  # rays are few, and not the same on both sides


def _spread(light, vertices, faces):
    """Light (n,) after it has gone through what it falls on: minimises |x - light|^2 + SOFT_MM^2 |grad x|^2."""
    mass = lumped_mass(vertices, faces) + 1e-9  # mm2; a vertex without faces keeps its light
    flow = SOFT_MM**2 * clamped_laplacian(vertices, faces)
    return spsolve((sp.diags(mass) + flow).tocsc(), mass * light)


def parts_behind_lips(template):
    """The parts of a template that are attached to skull or jaw: teeth, gums, tongue."""
    return [part for part in template.parts if part.attach in ATTACHED]


def shaded(image, template, parts, light):
    """An image (size, size, 3) uint8 sRGB of parts that share a material, darkened to the light (n,) of their vertices.

    Where parts share a texel it gets the mean of their light; beyond their charts the nearest texel counts.
    """
    size = len(image)
    total, count = np.zeros((size, size)), np.zeros((size, size))
    for part in parts:
        face, barycentric = raster_uv(template.uv, template.uv_faces[part.face_slice], size)
        seen = face >= 0
        corners = template.faces[part.face_slice][face[seen]]
        total[seen] += (light[corners] * barycentric[seen]).sum(axis=1)
        count[seen] += 1.0
    if not count.any():
        return image
    rows, columns = distance_transform_edt(count == 0, return_distances=False, return_indices=True)
    share = (total[rows, columns] / count[rows, columns])[..., None] ** np.array(WALLS)
    return (linear_to_srgb(srgb_to_linear(image / 255.0) * share) * 255 + 0.5).astype(np.uint8)
