"""One scan in many guises: other formats, poses, units, triangles, orders. Each is a file and the way back."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import dataclass, replace

import igl
import numpy as np
import scipy.sparse as sp
from PIL import Image
from scipy.ndimage import distance_transform_edt
from scipy.sparse.csgraph import connected_components

from facewright.data import Scan
from facewright.mesh.closest import Surface, interpolate
from facewright.mesh.raster import raster_uv
from facewright.mesh.render import sample_texture
from facewright.mesh.subdivide import split_in_four, with_midpoints
from facewright.sample.charts import layout

DECIMATED, SUBDIVIDED = 3_000, 500_000
TURNS = (((1, 2, 3), 77), ((-1, 0.2, 0.5), 164), ((0.1, 1, 0.1), 115), ((2, -1, 1), -100))


@dataclass(frozen=True)
class Variant:
    """name; kind: "format", "pose", "mesh" or "grey"; scan in its file's units; T (4, 4): x_variant = T x_original."""

    name: str
    kind: str
    scan: Scan
    T: np.ndarray
    extension: str = ".obj"


def all_variants(scan):
    """The Variants of a textured scan, in the order of the table; scan in its file's units, mm_per_unit its size."""
    one = np.eye(4)
    yield Variant("PLY", "format", scan, one, ".ply")
    in_metres = np.diag([scan.unit_mm / 1000.0] * 3 + [1.0])
    yield Variant("GLB", "format", moved(scan, in_metres), in_metres, ".glb")
    for number, (axis, degrees) in enumerate(TURNS):
        T = rotation(axis, degrees)
        T[:3, 3] = np.array([37.0, -120.0, 60.0]) / scan.unit_mm * (number + 1)
        yield Variant(f"turned {degrees} degrees", "pose", moved(scan, T), T)
    for name, mm in (("metres", 1000.0), ("centimetres", 10.0), ("inches", 25.4)):
        T = np.diag([scan.unit_mm / mm] * 3 + [1.0])
        yield Variant(name, "pose", moved(scan, T), T)
    yield Variant("decimated", "mesh", decimated(scan), one)
    yield Variant("subdivided", "mesh", subdivided(scan), one)
    yield Variant("shuffled", "mesh", shuffled(scan), one)
    yield Variant("grey", "grey", replace(scan, textures=(), face_texture=None, uv=None, uv_faces=None), one)


def moved(scan, T):
    """The scan with other coordinates in its file."""
    return replace(scan, vertices=scan.vertices @ T[:3, :3].T + T[:3, 3])


def rotation(axis, degrees):
    """(4, 4) turn about an axis."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    K = np.cross(np.eye(3), axis)
    angle = np.radians(degrees)
    T = np.eye(4)
    T[:3, :3] = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    return T


def decimated(scan, count=DECIMATED):
    """As many triangles, with a texture baked anew from the original."""
    V, F = manifold(scan.vertices, scan.faces)
    V, F, _, _ = igl.qslim(np.asfortranarray(V), np.asfortranarray(F, dtype=np.int32), count)
    V, F = np.asarray(V, float), np.asarray(F, np.int64)
    uv, uv_faces = layout(V * (scan.unit_mm or 1.0), F)
    face, barycentric = raster_uv(uv, uv_faces, 1024)
    covered = face >= 0
    nearest = Surface(scan.vertices, scan.faces).closest(interpolate(V, F, face[covered], barycentric[covered]))
    image = np.zeros((1024, 1024, 3), np.uint8)
    at = interpolate(scan.uv, scan.uv_faces, nearest.faces, nearest.barycentric)
    image[covered] = sample_texture(scan.textures[0], at)[:, :3]
    # As every baker does: colours go on past the borders of charts, or seams are drawn as black lines on the face.
    image = image[tuple(distance_transform_edt(~covered, return_distances=False, return_indices=True))]
    return Scan(V, F, uv=uv, uv_faces=uv_faces, textures=(image,), face_texture=np.zeros(len(F)), unit_mm=scan.unit_mm)


def manifold(V, F):
    """The same surface with every vertex split into as many as there are fans of faces around it."""
    half = np.stack([F, np.roll(F, -1, axis=1)], axis=2).reshape(-1, 2)  # edge e of face f goes from corner e to e + 1
    _, edge, shared = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.reshape(-1), kind="stable")
    first = np.cumsum(shared) - shared
    pairs = order[first[shared == 2][:, None] + [0, 1]]
    start, stop = pairs, pairs - pairs % 3 + (pairs + 1) % 3  # corners at both ends of the two half-edges
    same = half[pairs[:, 0], 0] == half[pairs[:, 1], 0]
    a = np.concatenate([start[:, 0], stop[:, 0]])
    b = np.concatenate([np.where(same, start[:, 1], stop[:, 1]), np.where(same, stop[:, 1], start[:, 1])])
    n = F.size
    fans, label = connected_components(sp.coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n)), directed=False)
    vertices = np.empty((fans, 3))
    vertices[label] = V[F.ravel()]
    return vertices, label.reshape(-1, 3).astype(np.int64)


def subdivided(scan, count=SUBDIVIDED):
    """Every triangle in four until the next step would be too many, then some in three up to the count."""
    V, F, uv, uv_faces = scan.vertices, scan.faces, scan.uv, scan.uv_faces
    while 4 * len(F) <= count:
        edges, F = split_in_four(F, len(V))
        uv_edges, uv_faces = split_in_four(uv_faces, len(uv))
        V, uv = with_midpoints(V, edges), with_midpoints(uv, uv_edges)
    some = np.arange(min((count - len(F)) // 2, len(F)))
    V, F = _split(V, F, some)
    uv, uv_faces = _split(uv, uv_faces, some)
    return replace(scan, vertices=V, faces=F, uv=uv, uv_faces=uv_faces, face_texture=np.zeros(len(F)), colors=None)


def _split(V, F, some):
    """The chosen triangles in three about their centre."""
    centers = len(V) + np.arange(len(some))
    a, b, c = F[some].T
    parts = [np.stack([a, b, centers], 1), np.stack([b, c, centers], 1), np.stack([c, a, centers], 1)]
    rest = np.delete(F, some, axis=0)
    return np.vstack([V, V[F[some]].mean(axis=1)]), np.vstack([rest, *parts])


def shuffled(scan, seed=5):
    """Another order of vertices and faces."""
    rng = np.random.default_rng(seed)
    order, faces = rng.permutation(len(scan.vertices)), rng.permutation(len(scan.faces))
    place = np.argsort(order)
    return replace(
        scan,
        vertices=scan.vertices[order],
        faces=place[scan.faces][faces],
        uv_faces=scan.uv_faces[faces],
        face_texture=scan.face_texture[faces],
        colors=None if scan.colors is None else scan.colors[order],
    )


def write_variant(variant, folder):
    """Write the variant into a folder; returns the path of its mesh."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"scan{variant.extension}"
    {".obj": _write_obj, ".ply": _write_ply, ".glb": _write_glb}[variant.extension](variant.scan, path)
    return path


def _write_texture(scan, folder):
    if scan.has_texture:
        Image.fromarray(scan.textures[0]).save(folder / "albedo.png")


def _write_obj(scan, path):
    _write_texture(scan, path.parent)
    lines = [f"v {x:.8g} {y:.8g} {z:.8g}" for x, y, z in scan.vertices.tolist()]
    if scan.has_texture:
        (path.parent / "scan.mtl").write_text("newmtl skin\nmap_Kd albedo.png\n")
        lines = ["mtllib scan.mtl", "usemtl skin", *lines]
        lines += [f"vt {u:.7g} {v:.7g}" for u, v in scan.uv.tolist()]
        corners = np.stack([scan.faces, scan.uv_faces], axis=2).reshape(-1, 6) + 1
        lines += [f"f {a}/{x} {b}/{y} {c}/{z}" for a, x, b, y, c, z in corners.tolist()]
    else:
        lines += [f"f {a} {b} {c}" for a, b, c in (scan.faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")


def _write_ply(scan, path):
    """Binary little-endian with texture coordinates per corner."""
    _write_texture(scan, path.parent)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment TextureFile albedo.png",
        f"element vertex {len(scan.vertices)}",
        *(f"property float {axis}" for axis in "xyz"),
        f"element face {len(scan.faces)}",
        "property list uchar int vertex_indices",
        "property list uchar float texcoord",
        "end_header",
    ]
    row = np.dtype([("n", "u1"), ("corner", "<i4", 3), ("m", "u1"), ("uv", "<f4", 6)])
    faces = np.empty(len(scan.faces), row)
    faces["n"], faces["m"] = 3, 6
    faces["corner"] = scan.faces
    faces["uv"] = scan.uv[scan.uv_faces].reshape(-1, 6)
    body = scan.vertices.astype("<f4").tobytes() + faces.tobytes()
    path.write_bytes(("\n".join(header) + "\n").encode() + body)


def _write_glb(scan, path):
    """One primitive, corners split where their texture coordinates differ, the texture inside as PNG."""
    pairs, index = np.unique(np.stack([scan.faces.ravel(), scan.uv_faces.ravel()], axis=1), axis=0, return_inverse=True)
    uv = scan.uv[pairs[:, 1]] * [1, -1] + [0, 1]
    stream = io.BytesIO()
    Image.fromarray(scan.textures[0]).save(stream, "PNG")
    position = scan.vertices[pairs[:, 0]].astype("<f4")
    blocks = [position.tobytes(), uv.astype("<f4").tobytes(), index.astype("<u4").tobytes(), stream.getvalue()]
    views, binary = [], b""
    for block in blocks:
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(block)})
        binary += block + b"\0" * (-len(block) % 4)
    bounds = {"min": position.min(axis=0).tolist(), "max": position.max(axis=0).tolist()}
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(pairs), "type": "VEC3", **bounds},
        {"bufferView": 1, "componentType": 5126, "count": len(pairs), "type": "VEC2"},
        {"bufferView": 2, "componentType": 5125, "count": index.size, "type": "SCALAR"},
    ]
    primitive = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
