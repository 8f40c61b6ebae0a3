"""The types in the middle of the hourglass: Scan, Template, Face and Rig.

Frozen dataclasses of read-only numpy arrays. Vertices are (n, 3) float64 in millimetres in our frame (see
conventions.py); faces are (m, 3) int64, counter-clockwise seen from outside; uv is (t, 2) float64 with v up and
uv_faces (m, 3) int64 indexes it corner by corner.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np


def _freeze(owner, name, dtype, shape=None, optional=False):
    """Convert a field to a read-only C-contiguous array and check its shape; -1 in shape stands for any length."""
    value = getattr(owner, name)
    if value is None and optional:
        return
    array = np.ascontiguousarray(value, dtype=dtype)
    if shape is not None:
        matches = array.ndim == len(shape) and all(want in (-1, got) for want, got in zip(shape, array.shape))
        if not matches:
            raise ValueError(f"{type(owner).__name__}.{name}: expected shape {shape}, got {array.shape}")
    if array is value and array.flags.writeable:
        array = array.copy()
    array.flags.writeable = False
    object.__setattr__(owner, name, array)


def _check_indices(owner, name, n):
    indices = getattr(owner, name)
    if indices is not None and indices.size and (indices.min() < 0 or indices.max() >= n):
        raise ValueError(f"{type(owner).__name__}.{name}: index outside 0..{n - 1}")


@dataclass(frozen=True)
class Scan:
    """A triangle mesh as the user gave it, and how to go back to the user's file.

    vertices     (n, 3) in the frame and unit that T_ours_to_scan maps to the file's own
    faces        (m, 3)
    uv, uv_faces (t, 2), (m, 3) or None; v up
    textures     tuple of (h, w, 3) uint8 sRGB images
    face_texture (m,) index into textures, -1 where a face has none; None without textures
    colors       (n, 3) float in 0..1, sRGB, or None
    normal_map   (h, w, 3) uint8 linear, +Y, in the scan's UVs, or None
    T_ours_to_scan (4, 4): x_file = T x_ours
    unit_mm      millimetres per file unit when the format or the user says so, else None
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None = None
    uv_faces: np.ndarray | None = None
    textures: tuple[np.ndarray, ...] = ()
    face_texture: np.ndarray | None = None
    colors: np.ndarray | None = None
    normal_map: np.ndarray | None = None
    T_ours_to_scan: np.ndarray = field(default_factory=lambda: np.eye(4))
    unit_mm: float | None = None
    name: str = "scan"
    notes: tuple[str, ...] = ()

    def __post_init__(self):
        _freeze(self, "vertices", np.float64, (-1, 3))
        _freeze(self, "faces", np.int64, (-1, 3))
        _freeze(self, "uv", np.float64, (-1, 2), optional=True)
        _freeze(self, "uv_faces", np.int64, (len(self.faces), 3), optional=True)
        _freeze(self, "face_texture", np.int64, (len(self.faces),), optional=True)
        _freeze(self, "colors", np.float64, (len(self.vertices), 3), optional=True)
        _freeze(self, "T_ours_to_scan", np.float64, (4, 4))
        _check_indices(self, "faces", len(self.vertices))
        if self.uv is not None:
            _check_indices(self, "uv_faces", len(self.uv))

    @property
    def has_texture(self):
        return bool(self.textures) and self.uv is not None

    def transformed(self, T):
        """The same scan in another frame: x_new = T x. T is (4, 4), a similarity; T_ours_to_scan follows."""
        vertices = self.vertices @ T[:3, :3].T + T[:3, 3]
        return replace(self, vertices=vertices, T_ours_to_scan=self.T_ours_to_scan @ np.linalg.inv(T))

    def __repr__(self):
        looks = "textured" if self.has_texture else "vertex colours" if self.colors is not None else "clay"
        return f"Scan({self.name!r}, {len(self.vertices)} vertices, {len(self.faces)} faces, {looks})"


@dataclass(frozen=True)
class Part:
    """A separate piece of a head: a range of vertices and faces of the template that shares one material.

    name      "skin", "eye_left", "eye_right", "teeth_upper", "teeth_lower", "tongue", "lashes_left", ...
    vertices  (start, stop) in the template's vertex array
    faces     (start, stop) in the template's face array
    material  name of a material in Template.materials
    attach    what carries it: "skin" (deforms with the head), "skull", "jaw", "eye_left", "eye_right", "lid_left" or
              "lid_right" (rides on that eye's lids)
    """

    name: str
    vertices: tuple[int, int]
    faces: tuple[int, int]
    material: str
    attach: str = "skin"

    @property
    def vertex_slice(self):
        return slice(*self.vertices)

    @property
    def face_slice(self):
        return slice(*self.faces)


@dataclass(frozen=True)
class Skeleton:
    """Joints of the rig. names[0] is the root; parents[i] < i, -1 for the root; positions (j, 3) mm."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    positions: np.ndarray

    def __post_init__(self):
        _freeze(self, "positions", np.float64, (len(self.names), 3))
        if len(self.parents) != len(self.names):
            raise ValueError(f"Skeleton: {len(self.names)} names but {len(self.parents)} parents")


@dataclass(frozen=True)
class Landmarks:
    """Points on a surface. names (k,), faces (k,) int, barycentric (k, 3), weight (k,) confidence in 0..1."""

    names: tuple[str, ...]
    faces: np.ndarray
    barycentric: np.ndarray
    weights: np.ndarray

    def __post_init__(self):
        k = len(self.names)
        _freeze(self, "faces", np.int64, (k,))
        _freeze(self, "barycentric", np.float64, (k, 3))
        _freeze(self, "weights", np.float64, (k,))

    def positions(self, vertices, faces):
        """(k, 3) points on the surface (vertices (n, 3), faces (m, 3))."""
        return np.einsum("kc,kcd->kd", self.barycentric, vertices[faces[self.faces]])


@dataclass(frozen=True, eq=False)
class Template:
    """A head as data. Vertices, faces, uv and mirror are frozen once released (topology_id).

    vertices  (n, 3) the neutral, all parts; the skin (with mouth bag, sockets, nostrils) comes first
    faces     (m, 3) triangles; polygons (p, 4) the same surface as quads, -1 pads a triangle
    uv, uv_faces  one 0-1 square per material; the skin's is the atlas that maps are baked in (no overlap)
    uv_polygons   (p, 4) like polygons, into uv
    mirror    (n,) vertex -> its twin across x = 0
    regions   name -> (n,) bool; see docs/template.md
    lines     name -> (k,) ordered vertex indices
    landmarks dense MediaPipe landmarks ("mp0".."mp477") and 68-point ones ("p1".."p68")
    shape_names, deltas   (s,), (s, n, 3) mm from neutral
    identity_basis (i, n, 3) mm, one standard deviation each
    openness  (n,) in 0..1: share of outside directions that see the vertex
    skin_weights (n, j), rows sum to 1
    materials name -> dict(color=(r, g, b) linear, roughness=.., alpha=..)
    info      dict: name, version, topology_id, licence, credits, and rules that were applied
    """

    vertices: np.ndarray
    faces: np.ndarray
    polygons: np.ndarray
    uv: np.ndarray
    uv_faces: np.ndarray
    uv_polygons: np.ndarray
    mirror: np.ndarray
    parts: tuple[Part, ...]
    regions: dict[str, np.ndarray]
    lines: dict[str, np.ndarray]
    landmarks: Landmarks
    shape_names: tuple[str, ...]
    deltas: np.ndarray
    identity_basis: np.ndarray
    openness: np.ndarray
    skeleton: Skeleton
    skin_weights: np.ndarray
    materials: dict[str, dict[str, Any]]
    info: dict[str, Any]

    def __post_init__(self):
        n = len(self.vertices)
        _freeze(self, "vertices", np.float64, (n, 3))
        _freeze(self, "faces", np.int64, (-1, 3))
        _freeze(self, "polygons", np.int64, (-1, 4))
        _freeze(self, "uv", np.float64, (-1, 2))
        _freeze(self, "uv_faces", np.int64, (len(self.faces), 3))
        _freeze(self, "uv_polygons", np.int64, (len(self.polygons), 4))
        _freeze(self, "mirror", np.int64, (n,))
        _freeze(self, "deltas", np.float64, (len(self.shape_names), n, 3))
        _freeze(self, "identity_basis", np.float64, (-1, n, 3))
        _freeze(self, "openness", np.float64, (n,))
        _freeze(self, "skin_weights", np.float64, (n, len(self.skeleton.names)))
        _check_indices(self, "faces", n)
        for name, mask in self.regions.items():
            if mask.shape != (n,) or mask.dtype != bool:
                raise ValueError(f"Template.regions[{name!r}]: expected ({n},) bool, got {mask.shape} {mask.dtype}")

    @property
    def skin(self):
        return self.parts[0]

    def part(self, name):
        for part in self.parts:
            if part.name == name:
                return part
        raise KeyError(name)

    def shape(self, name):
        """(n, 3) deltas of one named shape."""
        return self.deltas[self.shape_names.index(name)]

    def __repr__(self):
        return (
            f"Template({self.info.get('name')!r}, {len(self.vertices)} vertices, {len(self.shape_names)} shapes, "
            f"{len(self.identity_basis)} identity modes)"
        )


@dataclass(frozen=True)
class Face:
    """A template fitted to a person.

    template    the Template that was fitted
    vertices    (n, 3) the neutral of the rig: lids open, expression out
    fit         (n, 3) the fit to the scan as it is, before that
    regions, lines  as in Template, possibly refined for this person; later stages read these, not the template's
    observed    (n,) bool: the scan shows this vertex (else it follows the model)
    expression  dict shape -> weight that was found in the scan and taken out
    eyes_closed dict(left=bool, right=bool) as found on the scan
    stats       dict of numbers for the report
    """

    template: Template
    vertices: np.ndarray
    fit: np.ndarray
    regions: dict[str, np.ndarray]
    lines: dict[str, np.ndarray]
    observed: np.ndarray
    expression: dict[str, float]
    eyes_closed: dict[str, bool]
    stats: dict[str, Any]

    def __post_init__(self):
        n = len(self.template.vertices)
        _freeze(self, "vertices", np.float64, (n, 3))
        _freeze(self, "fit", np.float64, (n, 3))
        _freeze(self, "observed", bool, (n,))


@dataclass(frozen=True)
class Material:
    """color linear RGB in 0..1; textures are names in Rig.maps, or None."""

    name: str
    color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    roughness: float = 0.6
    alpha: float = 1.0
    albedo: str | None = None
    normal: str | None = None
    double_sided: bool = False


@dataclass(frozen=True)
class Mesh:
    """One drawable mesh of a rig. deltas is (t, n, 3) mm for all targets of the rig, or None if it never moves."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    polygons: np.ndarray
    uv: np.ndarray
    uv_faces: np.ndarray
    uv_polygons: np.ndarray
    material: Material
    skin_weights: np.ndarray
    deltas: np.ndarray | None = None

    def __post_init__(self):
        n = len(self.vertices)
        _freeze(self, "vertices", np.float64, (n, 3))
        _freeze(self, "faces", np.int64, (-1, 3))
        _freeze(self, "polygons", np.int64, (-1, 4))
        _freeze(self, "uv", np.float64, (-1, 2))
        _freeze(self, "uv_faces", np.int64, (len(self.faces), 3))
        _freeze(self, "uv_polygons", np.int64, (len(self.polygons), 4))
        _freeze(self, "skin_weights", np.float64, (n, -1))
        _freeze(self, "deltas", np.float64, (-1, n, 3), optional=True)
        _check_indices(self, "faces", n)


@dataclass(frozen=True)
class Rig:
    """Everything any writer needs: meshes with deltas per target, materials, maps, skeleton, metadata.

    meshes       tuple of Mesh; meshes[0] is the skin
    target_names (t,) the one list of targets that every moving mesh carries, in this order
    in_betweens  dict target -> {weight: target name of the in-between}; expand.py has the rule
    correctives  dict target -> tuple of driver names
    halves       dict sum -> (left, right): targets that stand for a target's two sides and add up to it
    expressions, visemes  dict name -> {shape: weight}
    maps         name -> (h, w, c) uint8 image; info["maps"][name] says colour space and convention
    regions      name -> (n_skin,) bool on meshes[0]; lines name -> vertex indices on meshes[0]
    info         dict: template, topology_id, credits, copyright, units, T_rig_to_scan (4x4 nested list), ...
    """

    meshes: tuple[Mesh, ...]
    target_names: tuple[str, ...]
    skeleton: Skeleton
    maps: dict[str, np.ndarray]
    regions: dict[str, np.ndarray]
    lines: dict[str, np.ndarray]
    info: dict[str, Any]
    in_betweens: dict[str, dict[float, str]] = field(default_factory=dict)
    correctives: dict[str, tuple[str, ...]] = field(default_factory=dict)
    halves: dict[str, tuple[str, ...]] = field(default_factory=dict)
    expressions: dict[str, dict[str, float]] = field(default_factory=dict)
    visemes: dict[str, dict[str, float]] = field(default_factory=dict)

    def __post_init__(self):
        for mesh in self.meshes:
            if mesh.deltas is not None and len(mesh.deltas) != len(self.target_names):
                raise ValueError(
                    f"Rig: mesh {mesh.name!r} has {len(mesh.deltas)} targets, the rig {len(self.target_names)}"
                )

    def plain(self):
        """The Rig without in-betweens, correctives and halves: for players that know one weight per shape."""
        extra = self._in_between_targets() | set(self.correctives) | self._half_targets()
        names = [name for name in self.target_names if name not in extra]
        return replace(self._with_targets(names), in_betweens={}, correctives={}, halves={})

    def full(self):
        """The Rig with halves in place of their sums, in-betweens and correctives: expand_weights plays it."""
        swap = dict(self.halves)
        for name, sides in self.halves.items():
            for weight, target in self.in_betweens.get(name, {}).items():
                swap[target] = tuple(self.in_betweens[half][weight] for half in sides)
        gone = self._half_targets()
        names = [spelt for name in self.target_names if name not in gone for spelt in swap.get(name, (name,))]
        in_betweens = {name: steps for name, steps in self.in_betweens.items() if name not in self.halves}
        return replace(self._with_targets(names), in_betweens=in_betweens)

    def _in_between_targets(self):
        return {target for steps in self.in_betweens.values() for target in steps.values()}

    def _half_targets(self):
        """Targets that a half has: itself and its in-betweens."""
        halves = {half for pair in self.halves.values() for half in pair}
        return halves | {target for half in halves for target in self.in_betweens.get(half, {}).values()}

    def _with_targets(self, names):
        """The same Rig with these targets only, in this order."""
        keep = [self.target_names.index(name) for name in names]
        meshes = tuple(mesh if mesh.deltas is None else replace(mesh, deltas=mesh.deltas[keep]) for mesh in self.meshes)
        return replace(self, meshes=meshes, target_names=tuple(names))

    def __repr__(self):
        return f"Rig({len(self.meshes)} meshes, {len(self.target_names)} targets, maps {sorted(self.maps)})"
