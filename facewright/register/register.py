"""Registration: a template fitted to one cleaned scan in our frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from facewright.data import Face
from facewright.mesh.normals import vertex_normals
from facewright.mesh.openness import vertex_openness
from facewright.mesh.render import sample_texture
from facewright.mesh.untangle import untangled
from facewright.register.correspond import Target
from facewright.register.interior import tuck_interior
from facewright.register.lines import DEEP_MM, CreaseOptions, arc_fractions, trace_crease
from facewright.register.model import Expressions, ModelOptions, fit_model
from facewright.register.neutral import take_out_expression
from facewright.register.nonrigid import Rows
from facewright.register.skin import contact_rows, fit_skin, line_rows, skin_rules, without_hair
from facewright.scan.landmarks import EYE_LEFT, EYE_RIGHT, LIPS_INNER, LIPS_OUTER, NOSE

# One slight smile is all the expression that is looked for on open-eyed rest faces: frowns, presses and brows, tried on
# heads with known truth, were mostly identity (lips 2.5 mm off with them, 1.1 without).
SMILE = ("mouthSmileLeft", "mouthSmileRight")
SIDES = {"left": "Left", "right": "Right"}
# How far a smile strays from rest, and shut lids from the template's blink.
SMILE_STD, SHUT_STD = 0.1, 0.15
SMOOTH_LANDMARKS = (50, 280, 205, 425, 117, 346, 101, 330, 36, 266, 151, 9, 108, 337)
KNOTTY = ("eyes", "lips", "socket_left", "socket_right")
LID_LANDMARKS = {
    "left": (362, 382, 381, 380, 374, 373, 390, 249, 263),
    "right": (133, 155, 154, 153, 145, 144, 163, 7, 33),
}
LINE_WEIGHT, CONTACT_WEIGHT, LID_CONTACT_WEIGHT = 2.0, 200.0, 10.0
PLACED_WEIGHT = 25.0
"""How much more than a found landmark one counts that a person placed."""


@dataclass(frozen=True)
class RegisterOptions:
    """eyes: "template" opens closed lids to the template's aperture, "as-scanned" leaves them."""

    eyes: str = "template"
    model: ModelOptions = field(default_factory=ModelOptions)


# (w_bend, w_stretch, tau mm, reach mm) per level; tuned on heads with known truth (bench/registration_truth.py):
# lower final stiffness gains distance and loses correspondence, so the last levels only take up the scan's detail.
LEVELS = tuple((w, w / 2, 3.0, 10.0) for w in (45.0, 20.0, 10.0, 5.0))
DETAIL = ((2.0, 0.5, 1.5, 4.0),)


def register(scan, landmarks, template, options=None, placed=()):
    """Fit a template to a scan.

    scan       data.Scan, cleaned, in our frame (mm)
    landmarks  data.Landmarks on the scan, MediaPipe names
    template   data.Template
    placed     names of landmarks that a person placed: they are obeyed to the end
    returns    data.Face: fit (as the scan is), vertices (neutral), regions, lines, observed, statistics
    """
    options = options or RegisterOptions()
    target = Target(scan.vertices, scan.faces, vertex_openness(scan.vertices, scan.faces))
    smooth = [landmarks.names.index(f"mp{i}") for i in SMOOTH_LANDMARKS]
    target.compare_roughness(landmarks.positions(scan.vertices, scan.faces)[smooth])
    pairs = _landmark_pairs(scan, landmarks, template, placed)
    closed = eyes_closed(pairs)
    model, names = _fit_model(template, target, pairs, closed, options.model)
    leading, line_stats = _leading_lines(scan, template, model, pairs, closed)
    stop = template.skin.vertices[1]
    faces = template.faces[template.skin.face_slice]
    rules, bald = without_hair(skin_rules(template), template, model.vertices, target)
    skin, matches = fit_skin(model.vertices[:stop], faces, target, rules, leading, LEVELS + DETAIL)
    interior, outer, led = _interior(template)
    fit = model.vertices.copy()
    steady = ~np.any([template.regions[name][:stop] for name in KNOTTY], axis=0)
    steady[[template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]]] = True
    fit[:stop] = untangled(tuck_interior(skin, faces, interior, outer, led), faces, steady)
    expression = {name: round(float(w), 4) for together, w in zip(names, model.expression) for name in together}
    neutral, removed = fit, {}
    if options.eyes == "template":
        rest, removed = take_out_expression(template, model, fit[:stop], expression)
        if removed:
            neutral = model.rest.copy()
            neutral[:stop] = untangled(tuck_interior(rest, faces, interior, outer, led), faces, steady)
    observed = np.zeros(len(fit), bool)
    observed[:stop] = matches.weights > 0.05
    stats = {
        "bald": bald,
        "model_rms_mm": model.rms,
        "identity_std": float(np.sqrt(np.mean(model.alpha**2))) if len(model.alpha) else 0.0,
        "landmarks_used": len(pairs.names),
        "landmark_mm": _landmark_error(pairs, fit),
        "expression_found": expression,
        "T_template_to_ours": model.T.tolist(),
        **line_stats,
    }
    return Face(
        template=template,
        vertices=neutral,
        fit=fit,
        regions=dict(template.regions) | {"hidden": _hidden(rules, observed)},
        lines=template.lines,
        observed=observed,
        expression=removed,
        eyes_closed=closed,
        stats=stats,
    )


@dataclass(frozen=True)
class _Pairs:
    """Landmarks that scan and template share: names (l,), points (l, 3) on the scan, rows (l, n), weights (l,).

    rest (l, 3) the same points on the template's neutral; by_hand (l,) bool: placed by a person
    """

    names: tuple[str, ...]
    points: np.ndarray
    rows: sp.csr_matrix
    weights: np.ndarray
    rest: np.ndarray
    by_hand: np.ndarray


def _landmark_pairs(scan, landmarks, template, placed):
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
    by_hand = np.array([name in placed for name in names], bool)
    weights = np.where(by_hand, PLACED_WEIGHT, landmarks.weights[on_scan])
    return _Pairs(names, points, rows, weights, rows @ template.vertices, by_hand)


def eyes_closed(pairs):
    """{"left": bool, "right": bool}: the lids' landmarks are nearer to each other than a fifth of the rest face's."""
    index = {name: i for i, name in enumerate(pairs.names)}
    lids = {"left": ((386, 374), (385, 380), (387, 373)), "right": ((159, 145), (158, 153), (160, 144))}
    widths = {"left": (362, 263), "right": (133, 33)}
    result = {}
    for side, columns in lids.items():
        ratio = []
        for points in (pairs.points, pairs.rest):
            ends = [points[index[f"mp{i}"]] for i in widths[side] if f"mp{i}" in index]
            gaps = [
                np.linalg.norm(points[index[f"mp{a}"]] - points[index[f"mp{b}"]])
                for a, b in columns
                if f"mp{a}" in index and f"mp{b}" in index
            ]
            width = np.linalg.norm(ends[0] - ends[1]) if len(ends) == 2 else np.inf
            ratio.append(float(np.mean(gaps)) / width if gaps else np.nan)
        result[side] = bool(ratio[0] < 0.45 * ratio[1])
    return result


def _expressions(template, closed):
    """What the scan may wear, as tuples of shapes and deltas: lids found shut, and a slight smile."""
    lids = [(f"eyeBlink{SIDES[side]}",) for side in SIDES if closed[side]]
    names = [SMILE, *lids]
    deltas = np.stack([sum(template.shape(name) for name in together) for together in names])
    expected = np.array([0.0] + [0.9] * len(lids))
    return names, Expressions(deltas, expected, np.array([SMILE_STD] + [SHUT_STD] * len(lids)))


def _fit_model(template, target, pairs, closed, options):
    names, expressions = _expressions(template, closed)
    stop = template.skin.vertices[1]
    rules = skin_rules(template)
    trust = np.zeros(len(template.vertices))
    trust[:stop] = rules.trust
    ears = template.regions["ear_left"] | template.regions["ear_right"]
    trust[~template.regions["face"] & ~ears] *= 0.3
    trust[template.regions["scalp"]] = 0.0  # it may be hair
    model = fit_model(
        template.vertices,
        template.identity_basis,
        expressions,
        template.faces[template.skin.face_slice],
        trust,
        rules,
        target,
        (pairs.points, pairs.rows, pairs.weights),
        options,
    )
    return model, names


def _hidden(rules, observed):
    """(n,) bool: where hair or cloth may lie and the scan was not believed; there the face follows the model."""
    hidden = np.zeros(len(observed), bool)
    hidden[: len(rules.hairy)] = rules.hairy & ~observed[: len(rules.hairy)]
    return hidden


def _interior(template):
    """(n_skin,) bool insides of mouth, sockets and nostrils and outer skin, indices of lip and lid lines."""
    stop = template.skin.vertices[1]
    names = ("mouth_interior", "socket_left", "socket_right", "nostrils")
    outer = template.regions["outer"][:stop]
    led = np.concatenate([line for name, line in template.lines.items() if name.startswith(("lip_seam", "lid_"))])
    return np.any([template.regions[name][:stop] for name in names], axis=0) & ~outer, outer, led


def _leading_lines(scan, template, model, pairs, closed):
    """The rows that lead the skin to feature lines found on the scan, and what to report."""
    stop = template.skin.vertices[1]
    faces = template.faces[template.skin.face_slice]
    normals = vertex_normals(model.vertices[:stop], faces)
    darkness = texture_darkness(scan)
    leading, stats = [], {}
    if pairs.by_hand.any():
        rows = Rows(
            pairs.rows[pairs.by_hand][:, :stop], pairs.points[pairs.by_hand], np.full(pairs.by_hand.sum(), 40.0)
        )
        leading.append(_always(rows))
    upper, lower = template.lines["lip_seam_upper"], template.lines["lip_seam_lower"]
    middle = 0.5 * (model.vertices[upper] + model.vertices[lower])
    forward = normals[template.regions["lips"][:stop]].mean(axis=0)
    crease = trace_crease(scan.vertices, scan.faces, middle, forward, CreaseOptions(), darkness)
    stats["lips_closed"] = crease.found
    stats["lip_crease_mm"] = float(np.median(crease.strength))
    if crease.found:
        for line in (upper, lower):
            leading.append(line_rows(line, crease, LINE_WEIGHT * crease_trust(crease), stop))
        rest = template.vertices[upper] - template.vertices[lower]
        contact = contact_rows(upper[1:-1], lower[1:-1], rest[1:-1], CONTACT_WEIGHT, stop)
        leading.append(_always(contact))
    for side in SIDES:
        if not closed[side]:
            continue
        lid_upper, lid_lower = template.lines[f"lid_upper_{side}"], template.lines[f"lid_lower_{side}"]
        line = _lid_line(pairs, side, model.vertices[lid_lower])
        lid = template.regions["eyes"][:stop] & (np.sign(template.vertices[:stop, 0]) == (1 if side == "left" else -1))
        crease = trace_crease(
            scan.vertices,
            scan.faces,
            _from_right(line),
            normals[lid].mean(axis=0),
            CreaseOptions(half_band_mm=3.0, overshoot_mm=2.0, prior_sigma_mm=1.5),
            darkness,
        )
        stats[f"lid_crease_{side}_mm"] = float(np.median(crease.strength))
        if crease.found:
            for margin in (lid_upper, lid_lower):
                leading.append(line_rows(margin, crease, LINE_WEIGHT * crease_trust(crease), stop))
            pairs_of_lids = _paired(lid_upper, lid_lower, model.vertices)
            rest = np.zeros((len(pairs_of_lids[0]), 3))
            contact = contact_rows(*pairs_of_lids, rest, LID_CONTACT_WEIGHT, stop)
            leading.append(_always(contact))
    return tuple(leading), stats


def _always(rows):
    return lambda _vertices: [rows]


def crease_trust(crease):
    """(k,) in 0.1..1: how far each point of a crease is believed, less towards its ends, which are hard to tell."""
    fractions = np.linspace(0, 1, len(crease.points))
    ends = np.clip(np.minimum(fractions, 1 - fractions) / 0.08, 0.25, 1.0)
    return ends * np.clip(crease.strength / DEEP_MM, 0.1, 1.0)


def _lid_line(pairs, side, otherwise):
    """(k, 3) where shut lids meet by the landmarks, inner to outer canthus; the model's line without landmarks."""
    index = {name: i for i, name in enumerate(pairs.names)}
    rows = [index[f"mp{i}"] for i in LID_LANDMARKS[side] if f"mp{i}" in index]
    return pairs.points[rows] if len(rows) >= 5 else otherwise


def _paired(upper, lower, vertices):
    """Two margins of different counts as pairs: each inner vertex of the upper with the lower's nearest by arc."""
    at, over = arc_fractions(vertices[upper]), arc_fractions(vertices[lower])
    nearest = np.abs(at[1:-1, None] - over[None, :]).argmin(axis=1)
    return upper[1:-1], lower[nearest]


def _from_right(line):
    return line if line[0, 0] < line[-1, 0] else line[::-1]


def texture_darkness(scan):
    """Function (faces, barycentric) -> darkness 0..1 of a textured scan, or None."""
    if not scan.has_texture:
        return None

    def darkness(faces, barycentric):
        uv = np.einsum("kc,kcd->kd", barycentric, scan.uv[scan.uv_faces[faces]])
        result = np.zeros(len(faces))
        which = scan.face_texture[faces] if scan.face_texture is not None else np.zeros(len(faces), np.int64)
        for i, image in enumerate(scan.textures):
            mine = which == i
            if mine.any():
                result[mine] = 1.0 - sample_texture(image, uv[mine])[:, :3].mean(axis=1) / 255.0
        return result

    return darkness


def _landmark_error(pairs, fit):
    error = np.linalg.norm(pairs.rows @ fit - pairs.points, axis=1)
    return {"mean": float(error.mean()), "p95": float(np.quantile(error, 0.95)), "max": float(error.max())}
