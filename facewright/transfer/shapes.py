"""All shapes of a template carried to a person: skin by deformation transfer, bones and eyes rigidly, the rest along.

Skin and mouth bag are one Poisson system with the skull held. Eyes turn about their own centres; lower teeth and tongue
turn with the jaw about the person's hinge, which is read off the skin that moves with it; lashes, fluid and gums are
a second, small system that hangs on the moved skin and bones.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from facewright.mesh.polyline import arc_lengths
from facewright.solve.procrustes import best_rotation, best_similarity
from facewright.transfer.deformation import DeformationTransfer, Links
from facewright.transfer.lids import ContactOptions, clear_lids
from facewright.transfer.riders import ride_on_lids
from facewright.transfer.strength import line_strengths

CORRECTIVE_BASE = {"mouthClose": "jawOpen"}
"""Shapes that are made on top of another one and mean nothing without it."""

_REST_SHARE, _REST_MM = 0.05, 1.0  # less than this share of a shape's largest motion, and than 1 mm, is rest
_HINGE_PULL = 0.02  # of the skin's weight: holds the hinge where the skin says little (along its axis)
_RIGID_SKIN_MM = 2.0  # skin that strays by this from the jaw's rigid motion counts little for the hinge


@dataclass(frozen=True)
class TransferOptions:
    """w_lids  how firmly the two lid margins keep their relation (closing stays closing); 0: not at all
    w_lips  the same for the line where the lips meet
    strengths whether the mouth's feature lines set how strong each shape is
    contact how lids are kept out of the eyeballs; None: not at all
    """

    w_lids: float = 5.0
    w_lips: float = 1.0
    strengths: bool = True
    contact: ContactOptions | None = field(default_factory=ContactOptions)


def transfer_shapes(face, options=None):
    """The shapes of face.template on a person: (s, n, 3) mm from face.vertices, in the template's order.

    face  data.Face with its parts in place (parts.fit_parts)
    """
    options = options or TransferOptions()
    template, V = face.template, face.vertices
    stop = template.skin.vertices[1]
    faces, weights = even_handed(template.faces[template.skin.face_slice], template.mirror)
    fixed = face.regions["skull"][:stop]
    if not fixed.any():
        fixed = ~template.deltas[:, :stop].any(axis=(0, 2))
    links = feature_links(face.lines, template.vertices, options)
    skin = DeformationTransfer(
        template.vertices[:stop], V[:stop], faces, fixed=fixed, links=links, face_weights=weights
    )
    result = np.zeros(template.deltas.shape)
    scale = best_similarity(template.vertices[:stop], V[:stop])[1]
    result[:, :stop] = _skin_shapes(skin, template.deltas[:, :stop], template.shape_names, scale)
    if options.strengths:
        result[:, :stop] *= _strengths(face, skin.rotation, result[:, :stop])[:, None, None]
    _carry_bones(template, V, skin.rotation, result)
    if options.contact is not None:
        result = clear_lids(face, result, options.contact)
    _carry_the_rest(template, V, skin.rotation, result)
    return ride_on_lids(face, result, template.shape_names)


def _strengths(face, rotation, carried):
    """(s,) factors of strength.line_strengths; 1 for what goes with the jaw, which turns by its own angle."""
    template = face.template
    stop = template.skin.vertices[1]
    source, deltas = template.vertices[:stop], template.deltas[:, :stop]
    factors = line_strengths(source, face.vertices[:stop], deltas, carried, face.lines, rotation)
    jaw = [part.vertex_slice for part in template.parts if part.attach == "jaw"]
    motion = [np.abs(template.deltas[:, part]).max(axis=(1, 2)) for part in jaw]
    with_jaw = np.max([np.zeros(len(factors)), *motion], axis=0) > _REST_MM
    corrective = [name in CORRECTIVE_BASE for name in template.shape_names]
    return np.where(with_jaw | np.array(corrective), 1.0, factors)


def even_handed(faces, mirror):
    """Triangles (m, 3) and weights (m,) that are the same on both sides of a head.

    Quads are cut along one diagonal, on some templates not the mirrored one on the other side. Where a triangle has no
    twin, it and its mirror image (the other cut of the twin quad) count half each; the rest count once.
    """
    n = len(mirror)
    twins = mirror[faces][:, [0, 2, 1]]
    keys, twin_keys = (np.sort(F, axis=1) @ [n * n, n, 1] for F in (faces, twins))
    alone = ~np.isin(twin_keys, keys)
    weights = np.where(alone, 0.5, 1.0)
    return np.concatenate([faces, twins[alone]]), np.append(weights, np.full(alone.sum(), 0.5))


def even_cut(faces, mirror, x):
    """Triangles (m, 3) with quads cut on the right as on the left, so that a head's sides are meshed alike.

    x (n,) of the template's vertices; quads across the midline stay as they are
    """
    twins = mirror[faces][:, [0, 2, 1]]
    n = len(mirror)
    keys, twin_keys = (np.sort(F, axis=1) @ [n * n, n, 1] for F in (faces, twins))
    alone = ~np.isin(twin_keys, keys)
    left, right = (x[faces] >= -1e-6).all(axis=1), (x[faces] <= 1e-6).all(axis=1)
    return np.concatenate([faces[~(alone & right)], twins[alone & left]])


def feature_links(lines, vertices, options=None):
    """Links between the lid margins of each eye and between the lips, from feature lines (as in Face)."""
    options = options or TransferOptions()
    links = []
    for side in ("left", "right"):
        upper, lower = lines.get(f"lid_upper_{side}"), lines.get(f"lid_lower_{side}")
        if upper is not None and lower is not None and options.w_lids > 0:
            links.append(_pair_lines(upper, lower, vertices, options.w_lids, by_gap=True))
    upper, lower = lines.get("lip_seam_upper"), lines.get("lip_seam_lower")
    if upper is not None and lower is not None and options.w_lips > 0:
        links.append(_pair_lines(upper, lower, vertices, options.w_lips, by_gap=False))
    return tuple(links)


def _pair_lines(one, other, vertices, weight, by_gap):
    """Links from each inner vertex of one line to its partner, else to the vertex at the same share of the length."""
    partner = np.arange(len(one))
    if len(one) != len(other):
        shares = [_along(vertices[line]) for line in (one, other)]
        partner = np.abs(shares[0][:, None] - shares[1][None]).argmin(axis=1)
    pairs = np.stack([one, other[partner]], axis=1)[1:-1]
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    return Links(pairs, np.full(len(pairs), weight), by_gap)


def _along(chain):
    """(k,) arc length from 0 to 1 along points (k, 3)."""
    steps = arc_lengths(chain)
    return steps / max(steps[-1], 1e-12)


def _skin_shapes(transfer, deltas, names, scale):
    """(s, n_skin, 3): shapes of the skin; correctives are the difference of the pose with them and the pose without.

    What is held should not move under any shape; where a template's does a little, it does so here.
    """
    pose = np.array(deltas)
    bases = {
        i: names.index(CORRECTIVE_BASE[name]) for i, name in enumerate(names) if CORRECTIVE_BASE.get(name) in names
    }
    for i, base in bases.items():
        pose[i] += deltas[base]
    expected = pose @ (scale * transfer.rotation.T)
    result = transfer.transfer(pose, held=expected)
    _settle(result, expected)
    for i, base in bases.items():
        result[i] -= result[base]
    return result


def _settle(result, expected):
    """Take drift out, in place: what hardly moves on the template moves just so on the person.

    Least squares spread the contradictions of a large motion over the whole face: opening the jaw by 35 mm pulled the
    eyelids of some people down by 0.6 mm. result, expected (s, n, 3): the shapes, and the template's turned and scaled
    """
    for shape, still in zip(result, expected):
        motion = np.linalg.norm(still, axis=1)
        limit = np.clip(_REST_SHARE * motion.max(), 1e-9, _REST_MM)
        rest = np.exp(-((motion / limit) ** 2))[:, None]
        shape += rest * (still - shape)


def _carry_bones(template, V, rotation, result):
    """Fill in the parts that turn as a whole: eyes, and what is attached to skull or jaw."""
    still = np.tile(np.eye(3), (len(template.shape_names), 1, 1))
    jaw_turns, hinge = still, np.zeros((2, 3))
    lead = _lead_of_jaw(template)
    if lead is not None:
        jaw_turns = _turns(*_aligned(template, lead, rotation))
        hinge = _hinges(template, V, rotation, lead, jaw_turns, result)
    for part in template.parts[1:]:
        source, deltas = _aligned(template, part, rotation)
        target = V[part.vertex_slice]
        similarity = best_similarity(source, target)
        if part.attach == "jaw":
            turns, pivots = jaw_turns, hinge
        elif part.attach.startswith("eye_"):
            ball = template.part(part.attach)  # iris and cornea turn with the ball, about the same point
            joint = rotation @ _joint(template, part.attach)
            similarity = best_similarity(_aligned(template, ball, rotation)[0], V[ball.vertex_slice])
            turns, pivots = _turns(*_aligned(template, ball, rotation)), (joint, _map(similarity, joint))
        else:
            continue  # the skull rests under every shape
        result[:, part.vertex_slice] = _turned(source, target, deltas, turns, pivots, similarity[1])


def _aligned(template, part, rotation):
    """Vertices (p, 3) and deltas (s, p, 3) of a part, turned onto the person."""
    return template.vertices[part.vertex_slice] @ rotation.T, template.deltas[:, part.vertex_slice] @ rotation.T


def _lead_of_jaw(template):
    """The part that shows how the jaw moves: the lower teeth, else whatever is attached to it, else None."""
    parts = [part for part in template.parts if part.attach == "jaw"]
    return next((part for part in parts if part.name == "teeth_lower"), parts[0] if parts else None)


def _joint(template, name):
    return template.skeleton.positions[template.skeleton.names.index(name)]


def _map(similarity, point):
    R, scale, t = similarity
    return scale * R @ point + t


def _turns(points, deltas):
    """(s, 3, 3) the rotation of points (p, 3) under each of deltas (s, p, 3); exactly none where nothing moves."""
    turns = np.tile(np.eye(3), (len(deltas), 1, 1))
    for turn, delta in zip(turns, deltas):
        if delta.any():
            turn[:] = best_rotation(points, points + delta)
    return turns


def _turned(source, target, deltas, turns, pivots, scale):
    """(s, p, 3): the target turns as the source about its own pivot; what is not a turn is scaled along.

    source, target (p, 3), deltas (s, p, 3) of the source, turns (s, 3, 3), pivots: a point (3,) of each
    """
    by = turns - np.eye(3)
    rest = deltas - (source - pivots[0]) @ by.transpose(0, 2, 1)
    return (target - pivots[1]) @ by.transpose(0, 2, 1) + scale * rest


def _hinges(template, V, rotation, lead, turns, result):
    """The jaw's hinge on the template (turned onto the person) and on the person, each (3,).

    The person's is where a turn as large as the template's explains the skin's motion under jawOpen best, strays of
    the skin from the bone's motion scaled along; sideways, and where there is no such shape, it keeps to the teeth.
    """
    source, deltas = _aligned(template, lead, rotation)
    similarity = best_similarity(source, V[lead.vertex_slice])
    joint = rotation @ _joint(template, "jaw")
    carried = _map(similarity, joint)
    if "jawOpen" not in template.shape_names:
        return joint, carried
    k = template.shape_names.index("jawOpen")
    by = turns[k] - np.eye(3)
    skin, skin_deltas = _aligned(template, template.skin, rotation)
    rest = skin_deltas[k] - (skin - joint) @ by.T
    bone = (deltas[k] - (source - joint) @ by.T).mean(axis=0)
    weights = np.exp(-((np.linalg.norm(rest - bone, axis=1) / _RIGID_SKIN_MM) ** 2))
    reach = np.linalg.norm(skin_deltas[k], axis=1)
    weights *= np.clip(reach / reach.max() - 0.1, 0.0, 1.0)
    if weights.sum() < 10 or np.linalg.norm(by) < 0.05:
        return joint, carried
    at = template.skin.vertex_slice
    offset = weights @ (result[k, at] - V[at] @ by.T - similarity[1] * rest) / weights.sum()
    pull = _HINGE_PULL * np.trace(by.T @ by)
    return joint, np.linalg.solve(by.T @ by + pull * np.eye(3), pull * carried - by.T @ offset)


def _carry_the_rest(template, V, rotation, result):
    """Fill in the parts that hang on the skin: a system of their own, with skin and bones as they move."""
    hanging = [part for part in template.parts[1:] if part.attach == "skin"]
    if not hanging or not any(template.deltas[:, part.vertex_slice].any() for part in hanging):
        return
    fixed = np.ones(len(V), bool)
    for part in hanging:
        fixed[part.vertex_slice] = False
    hang = DeformationTransfer(template.vertices, V, template.faces, fixed=fixed, rotation=rotation)
    result[:] = hang.transfer(template.deltas, held=result)
