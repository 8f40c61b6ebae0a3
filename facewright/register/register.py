"""Registration: a template fitted to one cleaned scan in our frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from facewright.data import Face
from facewright.mesh.openness import vertex_openness
from facewright.mesh.raster import RayScene
from facewright.register.colors import surface_colors
from facewright.register.correspond import Target
from facewright.register.ears import ear_motion, hidden_ears
from facewright.register.hair import hair_by_color
from facewright.register.leading import leading_lines
from facewright.register.lids import open_eyes
from facewright.register.localize import localized_basis
from facewright.register.mend import facing_the_scan, without_folds, without_knots
from facewright.register.model import Expressions, ModelOptions, fit_landmarks, fit_model
from facewright.register.neutral import take_out_expression
from facewright.register.pairs import (
    eyes_closed,
    landmark_errors,
    landmark_pairs,
    lid_names,
    on_lid_borders,
)
from facewright.register.refine import refine_model
from facewright.register.relief import lid_reliefs
from facewright.register.skin import fit_skin, skin_rules, welts, without_hair
from facewright.scan.pose import face_edge_mm

# One slight smile is all the expression that is looked for on open-eyed rest faces: frowns, presses and brows, tried on
# heads with known truth, were mostly identity (lips 2.5 mm off with them, 1.1 without).
SMILE = ("mouthSmileLeft", "mouthSmileRight")
SIDES = {"left": "Left", "right": "Right"}
# How far a smile strays from rest, and shut lids from the template's blink.
SMILE_STD, SHUT_STD = 0.1, 0.15
SMOOTH_LANDMARKS = (50, 280, 205, 425, 117, 346, 101, 330, 36, 266, 151, 9, 108, 337)
LANDMARK_MODES = 50  # of the identity, as many as some hundred landmarks can tell
PLAINLY_OPEN = 0.4  # several times what matters (Target.MIN_OPENNESS)


@dataclass(frozen=True)
class RegisterOptions:
    """eyes: "template" opens closed lids to the template's aperture, "as-scanned" leaves them."""

    eyes: str = "template"
    model: ModelOptions = field(default_factory=ModelOptions)


# (w_bend, w_stretch, tau mm, reach mm) per level; tuned on heads with known truth (bench/registration_truth.py):
# lower final stiffness gains distance and loses correspondence, so the last level only takes up the scan's detail. Four
# levels from 45 down to 5 took 1.5 core seconds more, and lips of hm08 were 0.58 mm off instead of 0.57.
LEVELS = ((10.0, 5.0, 3.0, 10.0),)
DETAIL = ((2.0, 0.5, 1.5, 4.0),)
# The model may miss the back of a bald head by 10 mm, for it only knows the face.
BALD = ((10.0, 5.0, 15.0, 30.0),)
# Facets are no detail: the last level draws the skin of a scan cut to 3,000 triangles (edges of 11 mm) 0.03 mm farther
# from the full one's, and what it is drawn to is the smoothed scan. A scan with edges of 4.6 mm needs that level: its
# lip seam is 0.9 mm off without, 0.5 with. Of an ear a dozen facets are left, which drag the jaw before it aside.
FACETS_MM = 8.0


def register(scan, landmarks, template, options=None, placed=()):
    """Fit a template to a scan.

    scan       data.Scan, cleaned, in our frame (mm)
    landmarks  data.Landmarks on the scan, MediaPipe names
    template   data.Template
    placed     names of landmarks that a person placed: they are obeyed to the end
    returns    data.Face: fit (as the scan is), vertices (neutral), regions, lines, observed, statistics
    """
    options = options or RegisterOptions()
    target = Target(scan.vertices, scan.faces, _openness(scan.vertices, scan.faces))
    smooth = [landmarks.names.index(f"mp{i}") for i in SMOOTH_LANDMARKS]
    skin_points = landmarks.positions(scan.vertices, scan.faces)[smooth]
    target.tell_skin(skin_points, hair_by_color(scan, skin_points))
    pairs = landmark_pairs(scan, landmarks, template, placed)
    basis = _localized_basis(template)
    closed, borders, pairs = _read_eyes(scan, template, basis, pairs, options.model)
    edge_mm = face_edge_mm(scan.vertices, scan.faces)
    finely = edge_mm <= FACETS_MM
    smooth = target.smoothed(edge_mm)
    rules = skin_rules(template)
    model, names = _fit_model(template, basis, smooth, rules, pairs, closed, options.model, finely)
    model = _with_ears(template, target, model)
    leading, line_stats = leading_lines(scan, template, model, pairs, closed, borders)
    stop = template.skin.vertices[1]
    faces = template.faces[template.skin.face_slice]
    rules, bald = without_hair(rules, template, model.vertices, target)
    skin, matches = _fit_skin(template, model, target, smooth, rules, leading, bald, finely)
    skin = facing_the_scan(template, skin, faces, matches, "lips")
    fit = model.vertices.copy()
    fit[:stop] = without_knots(template, facing_the_scan(template, skin, faces, matches, "eyes"), faces)
    fit[:stop] = without_folds(template, fit[:stop], faces, target.surface)
    expression = {name: round(float(w), 4) for together, w in zip(names, model.expression) for name in together}
    neutral, removed = fit, {}
    if options.eyes == "template":
        # What mends the rims of shut lids crumples them once they are open.
        rest, removed = take_out_expression(template, model, skin, expression)
        if removed:
            neutral = model.rest.copy()
            neutral[:stop] = without_knots(template, rest, faces)
    observed = np.zeros(len(fit), bool)
    observed[:stop] = matches.weights > 0.05
    stats = {
        "bald": bald,
        "model_rms_mm": model.rms,
        "identity_std": float(np.sqrt(np.mean(model.alpha**2))) if len(model.alpha) else 0.0,
        "landmarks_used": len(pairs.names),
        "landmark_mm": landmark_errors(pairs, fit),
        "lid_borders": sorted(side for side, lids in borders.items() if any(lids)),
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


@lru_cache(maxsize=1)
def _localized_basis(template):
    """The localised modes of a Template, made once for all scans that it is fitted to."""
    face, outer = template.regions["face"], template.regions["outer"]
    return localized_basis(template.vertices, template.identity_basis, face, outer)


def _openness(vertices, faces):
    """(n,) as vertex_openness, told from a quarter of the directions where it is plain that the surface is open."""
    rays = RayScene(vertices, faces)
    openness = vertex_openness(vertices, faces, n_directions=32, scene=rays)
    doubtful = np.flatnonzero(openness < PLAINLY_OPEN)
    openness[doubtful] = vertex_openness(vertices, faces, subset=doubtful, scene=rays)
    return openness


def _expressions(template, closed):
    """What the scan may wear, as tuples of shapes and deltas: lids found shut, and a slight smile."""
    lids = [(f"eyeBlink{SIDES[side]}",) for side in SIDES if closed[side]]
    names = [SMILE, *lids]
    deltas = np.stack([sum(template.shape(name) for name in together) for together in names])
    expected = np.array([0.0] + [0.9] * len(lids))
    return names, Expressions(deltas, expected, np.array([SMILE_STD] + [SHUT_STD] * len(lids)))


def _read_eyes(scan, template, basis, pairs, options):
    """Which eyes are shut; dict side -> (upper, lower) lids.Border of open ones, None where it is not clear; and the
    Pairs with the landmarks of lids on them.

    On a scan with colours the landmarks know the first and the colours the second; in clay the relief helps with both,
    and landmarks of open lids that it does not show are left out: lids of the model are nearer (of six made and real
    heads 0.95 mm off in height, 1.26 with them).
    """
    if surface_colors(scan) is not None:
        closed = eyes_closed(pairs)
        borders = open_eyes(scan, pairs, closed)
        return closed, borders, on_lid_borders(pairs, borders)
    others = pairs.without(set().union(*lid_names("left"), *lid_names("right")))
    _, expressions = _expressions(template, dict.fromkeys(SIDES, False))
    landmarks = (others.points, others.rows, others.weights)
    model = fit_landmarks(template.vertices, basis.first(LANDMARK_MODES), expressions, landmarks, options)
    reliefs = lid_reliefs(scan, template, model)
    closed = eyes_closed(pairs, {side: relief.openness for side, relief in reliefs.items()})
    placed = {name for name, by_hand in zip(pairs.names, pairs.by_hand) if by_hand}
    borders, unclear = {}, set()
    for side in SIDES:
        if not closed[side] and not placed & set().union(*lid_names(side)):
            borders[side] = reliefs[side].borders
            for border, names in zip(borders[side], lid_names(side)):
                unclear |= set() if border else names
    return closed, borders, on_lid_borders(pairs, borders).without(unclear)


def _fit_model(template, basis, target, rules, pairs, closed, options, finely):
    names, expressions = _expressions(template, closed)
    stop = template.skin.vertices[1]
    trust = np.zeros(len(template.vertices))
    trust[:stop] = rules.trust
    ears = template.regions["ear_left"] | template.regions["ear_right"]
    trust[~template.regions["face"] & ~ears] *= 0.3
    trust[template.regions["scalp"]] = 0.0  # it may be hair
    faces = template.faces[template.skin.face_slice]
    common = (faces, trust, rules, target)
    landmarks = (pairs.points, pairs.rows, pairs.weights)
    mean = template.vertices

    def hidden(vertices):
        return _hidden_ears(template, target, vertices, roughly=True)

    model = fit_model(mean, basis, expressions, *common, landmarks, options, hidden)
    seen = np.where(hidden(model.vertices), 0.0, trust)
    return refine_model(model, mean, template.identity_basis, faces, seen, rules, target, finely), names


def _fit_skin(template, model, target, smooth, rules, leading, bald, finely):
    """The skin (n, 3) drawn from the ModelFit to the scan, or to its smooth Target where it has facets, and the last
    Matches; not to what hides an ear, nor up a hairline.
    """
    stop = template.skin.vertices[1]
    faces = template.faces[template.skin.face_slice]
    surface, levels, hidden = smooth, LEVELS, np.any(_ears(template), axis=0)
    if finely:
        surface, levels, hidden = target, LEVELS + DETAIL, _hidden_ears(template, target, model.vertices)[:stop]

    def fitted(left_out):
        believed = replace(rules, trust=np.where(left_out, 0.0, rules.trust))
        return fit_skin(model.vertices[:stop], faces, surface, believed, leading, BALD * bald + levels)

    skin, matches = fitted(hidden)
    hairline = welts(template, skin, faces, target.surface, rules.hairy)
    return fitted(hidden | hairline) if hairline.any() else (skin, matches)


def _with_ears(template, target, model):
    """The ModelFit with ears where and as large as the scan's."""
    stop = template.skin.vertices[1]
    motion = np.zeros_like(model.vertices)
    faces, ears = template.faces[template.skin.face_slice], _ears(template)
    motion[:stop] = ear_motion(model.vertices[:stop], faces, ears, target)
    return replace(model, vertices=model.vertices + motion, rest=model.rest + motion)


def _hidden_ears(template, target, vertices, roughly=False):
    """(n,) bool: vertices (n, 3) of ears that the scan does not show; roughly as hidden_ears takes it."""
    stop = template.skin.vertices[1]
    hidden = np.zeros(len(vertices), bool)
    faces = template.faces[template.skin.face_slice]
    hidden[:stop] = hidden_ears(vertices[:stop], faces, _ears(template), target, roughly=roughly)
    return hidden


def _ears(template):
    """Masks (n,) of the skin's ears."""
    return [template.regions[f"ear_{side}"][: template.skin.vertices[1]] for side in SIDES]


def _hidden(rules, observed):
    """(n,) bool: where hair or cloth may lie and the scan was not believed; there the face follows the model."""
    hidden = np.zeros(len(observed), bool)
    hidden[: len(rules.hairy)] = (rules.hairy | rules.curtained) & ~observed[: len(rules.hairy)]
    return hidden
