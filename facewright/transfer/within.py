"""Shapes that stay what they are: within their regions and their amplitudes in the working set."""

from __future__ import annotations

import numpy as np

from facewright.conventions import INTERPUPILLARY_MM
from facewright.mesh.fade import smooth_step
from facewright.transfer.eyeball import carried_eyeball
from facewright.working_set import read_working_set, region_depth

FADE_MM = 6.0
SCALED = ("mouth", "cheek", "brow")  # regions whose shapes go along straight lines; eyes and jaws turn
MARGIN = 0.03  # of an amplitude, left for what contact adds or takes


def keep_within_regions(face, deltas):
    """Shapes (s, n, 3) mm of a data.Face, named as its template's, at rest outside their regions.

    Transfer spreads a little of every shape over the whole head: tenths of a millimetre that an animator sees as a
    forehead that breathes with the mouth. Names that the working set does not know are left alone.
    """
    result = np.array(deltas)
    for delta, share in zip(result, region_shares(face, face.template.shape_names)):
        delta[face.template.skin.vertex_slice] *= share
    return result


def region_shares(face, names):
    """For each shape that is named (n_skin, 1) in 0..1, how much of it the skin of a data.Face may show.

    1 inside of its region and in what is not seen, fading to 0 at its border; 1.0 for a name the working set lacks.
    """
    words = read_working_set()
    skin = face.template.skin.vertex_slice
    outer = face.regions["outer"][skin]
    scale = scale_of(face)
    fades = {}
    for name in names:
        word = words.words.get(name)
        if word is None:
            yield 1.0
            continue
        key = word.region, word.side
        if key not in fades:
            depth = region_depth(face.vertices[skin], face.lines, words.regions[word.region], word.side, scale)
            fades[key] = np.where(outer, smooth_step(depth / FADE_MM), 1.0)[:, None]
        yield fades[key]


def keep_within_amplitudes(face, deltas):
    """Shapes (s, n, 3) mm of a data.Face scaled so far as they are weaker or stronger than the working set says."""
    words, scale = read_working_set().words, scale_of(face)
    seam = face.lines["lip_seam_upper"]  # from the person's right to the left
    asked = {"corner_left": seam[[-1]], "corner_right": seam[[0]], "skin": face.regions["outer"]}
    asked |= {part.name: part.vertex_slice for part in face.template.parts if part.name == "tongue"}
    result = np.array(deltas)
    for shape, name in zip(result, face.template.shape_names):
        word = words.get(name)
        if word is None or not (word.region in SCALED or word.at == "tongue"):
            continue
        at = asked.get(f"corner_{word.side}" if word.at == "corner" else word.at)
        amplitude = 0.0 if at is None else float(np.linalg.norm(shape[at], axis=1).max(initial=0.0)) * scale
        if amplitude > 0.0:
            least, most = word.amplitude
            # With the tongue come jaw and lips, which go no farther for its sake.
            shape[at if word.at == "tongue" else ...] *= (
                np.clip(amplitude, (1.0 + MARGIN) * least, (1.0 - MARGIN) * most) / amplitude
            )
    return result


def scale_of(face):
    """Factor that brings a head to 63 mm between the eyes."""
    centers = [carried_eyeball(face.template, face.vertices, side).center for side in ("left", "right")]
    return INTERPUPILLARY_MM / float(np.linalg.norm(centers[0] - centers[1]))
