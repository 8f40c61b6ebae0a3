"""The pair of eyeballs; hm08's own strips of teeth and its tongue."""

from __future__ import annotations

import numpy as np

from hm08.eyeball import eyeball
from hm08.subdivide import triangulate


def mirrored_polygons(polygons):
    """The same polygons wound the other way."""
    turned = polygons[:, [0, 2, 1, 3]].copy()
    quad = polygons[:, 3] >= 0
    turned[quad] = polygons[quad][:, [0, 3, 2, 1]]
    return turned


def eye_pair(center):
    """dict of the two eyes: name -> (vertices, polygons, uv); the right one is the left one's mirror image.

    Both textures stand upright: u grows to the person's left on both eyes.
    """
    vertices, polygons, uv = eyeball()
    left = vertices + center
    # Cut from corner 0 to 2; the mirrored winding keeps corners 0 and 2.
    return {
        "eye_left": (left, polygons, uv),
        "eye_right": (left * [-1, 1, 1], mirrored_polygons(polygons), uv * [-1, 1] + [1, 0]),
    }


def simple_part(control, name):
    """vertices, polygons, mirror (local) and control indices of teeth or tongue as hm08 has them."""
    quads = control.part_quads[name]
    index = np.unique(quads)
    local = np.full(len(control.vertices), -1)
    local[index] = np.arange(len(index))
    vertices, mirror = control.vertices[index], local[control.mirror[index]]
    _, polygons = triangulate(local[quads], vertices, np.append(mirror, -1))
    return vertices, polygons, mirror, index
