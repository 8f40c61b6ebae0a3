"""A GLB with named morph targets as a Rig, as far as it can be known: to measure rigs of any maker.

Shapes are found under Apple's names and the spellings that others use (eyeBlink_L, EyeBlinkLeft). Regions, feature
lines and maps are not in a GLB, so they stay empty. Files of ours say in the scene's extras how targets are played; of
others "name@0.5" and "a+b" are taken at their word.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from facewright.conventions import ARKIT_SHAPES, CORRECTIVE_JOIN
from facewright.data import Material, Mesh, Rig, Skeleton
from facewright.errors import InputError
from facewright.read.gltf import MM_PER_METRE, _as_triangles, _open, _Reader

_TRIANGLES = 4


def read_gltf_rig(path):
    """The Rig in a .glb or .gltf file; InputError if no mesh of it has named targets."""
    path = Path(path)
    document, binary = _open(path)
    try:
        meshes, names = _meshes(_Reader(path, document, binary), document)
        skeleton = _skeleton(document)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, struct.error) as error:
        raise InputError(f"{path.name}: is a damaged glTF ({type(error).__name__}: {error}); export it again") from None
    if not names:
        raise InputError(f"{path.name}: no mesh has morph targets with names (mesh.extras.targetNames)")
    meshes.sort(key=lambda mesh: (mesh.deltas is None, -len(mesh.vertices)))
    width = len(skeleton.names)
    meshes = [_with_weights(mesh, width) for mesh in meshes]
    scenes = document.get("scenes") or [{}]
    told = scenes[document.get("scene", 0)].get("extras", {})
    tables = told.get("facewright", {}) if isinstance(told, dict) else {}
    return Rig(
        meshes=tuple(meshes),
        target_names=tuple(names),
        skeleton=skeleton,
        maps={},
        regions={},
        lines={},
        info={"template": None, "file": path.name},
        in_betweens=_in_betweens(tables, names),
        correctives=_correctives(tables, names),
        halves={name: tuple(sides) for name, sides in tables.get("halves", {}).items()},
        expressions=tables.get("expressions", {}),
        visemes=tables.get("visemes", {}),
    )


def apple_name(name):
    """A target's name as Apple spells it, where it is one of the 52: eyeBlink_L and EyeBlinkLeft are eyeBlinkLeft."""
    plain = name.rpartition(".")[2].replace("_", "")
    for spelt in (plain, *([plain[:-1] + {"L": "Left", "R": "Right"}[plain[-1]]] if plain[-1:] in ("L", "R") else [])):
        if spelt.lower() in _APPLE:
            return _APPLE[spelt.lower()]
    return name


_APPLE = {name.lower(): name for name in ARKIT_SHAPES}


def _meshes(reader, document):
    """The meshes of a document, millimetres, and the one list of target names that those with targets share."""
    found, names = [], []
    placed = list(reader._placed_meshes())
    for index, _ in placed:
        own = document["meshes"][index].get("extras", {}).get("targetNames", [])
        names += [apple_name(name) for name in own if apple_name(name) not in names]
    for index, matrix in placed:
        entry = document["meshes"][index]
        skinned = any(node.get("mesh") == index and "skin" in node for node in document["nodes"])
        place = np.eye(4) if skinned else matrix  # a skinned mesh stands where its joints are
        own = [apple_name(name) for name in entry.get("extras", {}).get("targetNames", [])]
        for primitive in entry["primitives"]:
            if primitive.get("mode", _TRIANGLES) == _TRIANGLES:
                found.append(_mesh(reader, entry.get("name", f"mesh {index}"), primitive, place, own, names))
    return found, names


def _mesh(reader, name, primitive, place, own, names):
    """One primitive as a Mesh whose vertices are welded where seams of the textures doubled them."""
    attributes, indices = reader._attributes(primitive)
    positions = attributes["POSITION"]
    faces = _as_triangles(indices if indices is not None else np.arange(len(positions)), _TRIANGLES)
    deltas = None
    if own and primitive.get("targets"):
        deltas = np.zeros((len(names), len(positions), 3))
        for target, shape in zip(primitive["targets"], own):
            if "POSITION" in target:
                deltas[names.index(shape)] = reader._accessor(target["POSITION"])
    first, inverse = _welded(positions, deltas)
    joints = _joint_weights(attributes)
    vertices = positions[first] @ place[:3, :3].T + place[:3, 3]
    faces = inverse[faces]
    padded = np.column_stack([faces, np.full(len(faces), -1)])
    none = np.zeros_like(faces)
    return Mesh(
        name=name,
        vertices=vertices * MM_PER_METRE,
        faces=faces,
        polygons=padded,
        uv=np.zeros((1, 2)),
        uv_faces=none,
        uv_polygons=np.where(padded < 0, -1, 0),
        material=Material(name),
        skin_weights=joints[first] if joints is not None else np.ones((len(first), 1)),
        deltas=None if deltas is None else deltas[:, first] @ place[:3, :3].T * MM_PER_METRE,
    )


def _welded(positions, deltas):
    """Index of the first of each set of equal vertices, and (n,) the set of each: equal in place and in all targets."""
    keys = [positions]
    if deltas is not None:
        directions = np.random.default_rng(0).normal(size=(2, len(deltas), 3))
        keys.append(np.einsum("dtc,tnc->nd", directions, deltas))
    _, first, inverse = np.unique(np.column_stack(keys), axis=0, return_index=True, return_inverse=True)
    return first, inverse.reshape(-1)


def _joint_weights(attributes):
    """(n, j) weights of JOINTS_0 and WEIGHTS_0, or None."""
    if "JOINTS_0" not in attributes or "WEIGHTS_0" not in attributes:
        return None
    joints = np.rint(attributes["JOINTS_0"]).astype(np.int64)
    weights = np.zeros((len(joints), int(joints.max(initial=0)) + 1))
    np.add.at(weights, (np.arange(len(joints))[:, None], joints), attributes["WEIGHTS_0"])
    return weights


def _with_weights(mesh, width):
    """The mesh with weights of exactly width joints."""
    weights = np.zeros((len(mesh.vertices), width))
    own = mesh.skin_weights[:, :width]
    weights[:, : own.shape[1]] = own
    return Mesh(**{**vars(mesh), "skin_weights": weights})


def _skeleton(document):
    """The joints of the first skin, mm; one joint at the origin where there is none."""
    skins = document.get("skins", [])
    if not skins:
        return Skeleton(("root",), (-1,), np.zeros((1, 3)))
    nodes, joints = document["nodes"], skins[0]["joints"]
    above = {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}
    positions = []
    for joint in joints:
        place, node = np.zeros(3), joint
        while node is not None:
            place = place + np.array(nodes[node].get("translation", [0.0, 0.0, 0.0]))
            node = above.get(node)
        positions.append(place * MM_PER_METRE)
    names = tuple(nodes[joint].get("name", f"joint {joint}") for joint in joints)
    parents = tuple(joints.index(above[joint]) if above.get(joint) in joints else -1 for joint in joints)
    return Skeleton(names, parents, np.array(positions))


def _in_betweens(tables, names):
    """shape -> {weight: target}: as the file says, else from names like "eyeBlinkLeft@0.5"."""
    if "inBetweens" in tables:
        return {name: {float(at): to for at, to in steps.items()} for name, steps in tables["inBetweens"].items()}
    found: dict[str, dict[float, str]] = {}
    for target in names:
        name, _, weight = target.partition("@")
        if weight.replace(".", "", 1).isdigit() and name in names and 0.0 < float(weight) < 1.0:
            found.setdefault(name, {})[float(weight)] = target
    return found


def _correctives(tables, names):
    """target -> drivers: as the file says, else from names like "eyeBlinkLeft+eyeSquintLeft"."""
    if "correctives" in tables:
        return {target: tuple(drivers) for target, drivers in tables["correctives"].items()}
    split = {target: tuple(target.split(CORRECTIVE_JOIN)) for target in names if CORRECTIVE_JOIN in target}
    return {target: drivers for target, drivers in split.items() if set(drivers) <= set(names)}
