"""Shapes that stay where they belong: each fades out towards the border of its region in the working set."""

from __future__ import annotations

import numpy as np

from facewright.conventions import INTERPUPILLARY_MM
from facewright.transfer.eyeball import carried_eyeball
from facewright.working_set import read_working_set, region_depth

FADE_MM = 6.0


def keep_within_regions(face, deltas):
    """Shapes (s, n, 3) mm of a data.Face, named as its template's, at rest outside their regions.

    Transfer spreads a little of every shape over the whole head: tenths of a millimetre that an animator sees as a
    forehead that breathes with the mouth. Names that the working set does not know are left alone.
    """
    words = read_working_set()
    skin = face.template.skin.vertex_slice
    outer = face.regions["outer"][skin]
    centers = [carried_eyeball(face.template, face.vertices, side).center for side in ("left", "right")]
    scale = INTERPUPILLARY_MM / float(np.linalg.norm(centers[0] - centers[1]))
    result = np.array(deltas)
    fades = {}
    for i, name in enumerate(face.template.shape_names):
        word = words.words.get(name)
        if word is None:
            continue
        key = word.region, word.side
        if key not in fades:
            depth = region_depth(face.vertices[skin], face.lines, words.regions[word.region], word.side, scale)
            share = np.clip(depth / FADE_MM, 0.0, 1.0)
            fades[key] = np.where(outer, share * share * (3 - 2 * share), 1.0)[:, None]
        result[i, skin] *= fades[key]
    return result
