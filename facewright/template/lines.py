"""Feature lines of a head: closed edge loops found as narrowest cuts, and chains between their ends.

Lid margins, lip contact and nostril rims are where the surface is narrowest between an inside and the outside, so a
minimum cut finds them on any mesh whose edges follow them. The red of the lips has no such cut: a description names
a few stops of its border.
"""

from __future__ import annotations

import numpy as np

from facewright.errors import StageError
from facewright.mesh.adjacency import border_loops
from facewright.mesh.closest import Surface
from facewright.mesh.normals import normalized, vertex_normals
from facewright.mesh.raster import RayScene
from facewright.mesh.seam import seam_sides
from facewright.template.loops import paired, separating_loop, shortest_path, split_loop, straightened
from facewright.template.regions import Loops, enclosed, eye_pouch, mouth_bag, polygons_within, seen_from_inside


def find_loops(head, openness):
    """The Loops of a regions.Head; openness (n,) of its skin."""
    lips = _mouth_loop(head)
    return Loops(_lid_loop(head), lips, _nostril_loop(head, openness, lips))


def feature_lines(head, loops, stops=None):
    """name -> (k,) vertices of every canonical line of the skin; docs/template.md says what each means.

    stops    line name -> vertices that it passes, for lines that cannot be found by form
    Lines of the left side are found, those of the right are their twins, so left and right always agree.
    """
    stops = stops or {}
    x, twin = head.vertices[:, 0], head.mirror
    lid, lips = loops.lid, loops.lips
    upper, lower = _upper_first(head, *split_loop(lid, lid[np.argmin(x[lid])], lid[np.argmax(x[lid])]))
    lines = dict(zip(("lip_seam_upper", "lip_seam_lower"), _seam(head, lips)))
    for name in ("lip_outer_upper", "lip_outer_lower"):
        if name in stops:
            lines[name] = shortest_path(head.vertices, head.polygons, stops[name])
    lines |= {"lid_upper_left": upper, "lid_lower_left": lower}
    lines |= {"lid_upper_right": twin[upper], "lid_lower_right": twin[lower]}
    lines |= {"nostril_left": loops.nostril, "nostril_right": twin[loops.nostril]}
    borders = border_loops(head.faces)
    if borders:
        lines["neck_ring"] = borders[0]
    return lines


def _seam(head, lips):
    """Paired upper and lower seam from the right corner to the left: paired on the left half, mirrored to the right."""
    chains = _chains(head, lips)
    middles = [np.flatnonzero(head.midline[chain]) for chain in chains]
    if any(len(middle) != 1 for middle in middles):
        return paired(head.vertices, *chains)
    halves = paired(head.vertices, *(chain[middle[0] :] for chain, middle in zip(chains, middles)))
    return tuple(np.concatenate([head.mirror[half[:0:-1]], half]) for half in halves)


def _upper_first(head, first, second):
    y = head.vertices[:, 1]
    return (first, second) if y[first].mean() > y[second].mean() else (second, first)


def _lid_loop(head):
    far = np.linalg.norm(head.vertices - head.eyes[0], axis=1) > 45 * head.scale
    return separating_loop(
        head.vertices,
        head.polygons,
        polygons_within(eye_pouch(head), head.polygons),
        polygons_within(far, head.polygons),
    )


def _mouth_loop(head):
    """Edges where the two lips are near each other are cheap, so that the line of contact wins over other rings.

    At first "near" is what lies ahead of a vertex; once a loop tells the lips apart, their distance decides.
    """
    bag = mouth_bag(head)
    opening = np.array([0.0, head.mouth[1], head.vertices[bag, 2].max() + 15 * head.scale])
    far = ~seen_from_inside(head, head.mouth, 90 * head.scale)
    far &= np.linalg.norm(head.vertices - opening, axis=1) > 50 * head.scale
    inside, outside = polygons_within(bag, head.polygons), polygons_within(far, head.polygons)
    loop = _cheapest_ring(head, inside, outside, _gap_ahead(head))
    return _cheapest_ring(head, inside, outside, _gap_between(head, _chains(head, loop)))


def _cheapest_ring(head, inside, outside, gap):
    """The closed ring between two sets of polygons along which gap (n,) mm is least."""
    limited = np.minimum(gap, 4 * head.scale)

    def factor(edges):
        return 0.3 + limited[edges].mean(axis=1)

    loop = separating_loop(head.vertices, head.polygons, inside, outside, edge_factor=factor)
    return straightened(head.vertices, head.polygons, loop, edge_factor=factor)


def _chains(head, lips):
    """Upper and lower chain of the lip loop, from the right corner to the left."""
    corner = lips[np.argmax(head.vertices[lips, 0])]
    return _upper_first(head, *split_loop(lips, head.mirror[corner], corner))


def _gap_between(head, chains):
    """(n,) mm from each lip vertex to the other lip; inf elsewhere."""
    sides = seam_sides(head.vertices, head.faces, *chains)
    gap = np.full(len(head.vertices), np.inf)
    for mine, other in (sides, sides[::-1]):
        patch = head.faces[other[head.faces].all(axis=1)]
        gap[mine] = Surface(head.vertices, patch).closest(head.vertices[mine]).distance
    return gap


def _gap_ahead(head):
    """(n,) mm from each vertex to the next skin in front of it: the least over a cone about the normal."""
    normals = vertex_normals(head.vertices, head.faces)
    scene = RayScene(head.vertices, head.faces)
    gap = np.full(len(head.vertices), np.inf)
    for tilt in np.vstack([np.zeros((1, 3)), 0.35 * np.eye(3), -0.35 * np.eye(3)]):
        gap = np.minimum(gap, scene.cast(head.vertices + 0.05 * normals, normalized(normals + tilt)).distance)
    return gap


def _nostril_loop(head, openness, lips):
    """The left nostril's rim runs between its dark inside and the light, where openness is about a half."""
    v, scale = head.vertices, head.scale
    blocked = enclosed(head.polygons, len(v), lips, mouth_bag(head))
    tip = _nose_tip(head, openness)
    around = np.linalg.norm(v - tip - np.array([0, -5, -10]) * scale, axis=1) < 24 * scale
    dark = around & ~blocked & (openness < 0.2) & (v[:, 0] > 0)
    bright = (openness > 0.75) | ~around | (v[:, 0] < 0)
    if not polygons_within(dark, head.polygons).any():
        raise StageError("template", "no_nostril", "no dark pit was found beneath the nose tip")
    return separating_loop(
        v,
        head.polygons,
        polygons_within(dark, head.polygons),
        polygons_within(bright & ~dark, head.polygons),
        edge_factor=lambda edges: 0.4 + 3 * (2 * openness[edges].mean(axis=1) - 0.9) ** 2,
    )


def _nose_tip(head, openness):
    """(3,) the foremost open midline point below the eyes and above the mouth."""
    v = head.vertices
    between = head.midline & (openness > 0.6) & (v[:, 1] < head.eyes[:, 1].mean()) & (v[:, 1] > head.mouth[1])
    if not between.any():
        raise StageError("template", "no_nose", "no open midline vertex lies between eyes and mouth")
    index = np.flatnonzero(between)
    return v[index[np.argmax(v[index, 2])]]
