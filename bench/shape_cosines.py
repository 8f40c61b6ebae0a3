"""Do a template's shapes mean what others mean by the same names: directions beside ICT's and beside the phone's.

    python bench/shape_cosines.py [--template hm08|FOLDER] [--ict FOLDER] [--phone FILE.npz]

The template is fitted to the other neutral as if that were a scan (kept in bench/cache), its shapes are carried there,
and both are compared at points that lie on each other. First table: mean cosine of the directions of motion, weighted
by ICT's, where ICT's shape moves by more than 0.5 mm. Second: which of the phone's 51 shapes is nearest to each, by the
cosine of the whole field.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cases import fingerprint
from common import CACHE, ROOT, Verdict, print_table

from facewright.contact import solve_eyes
from facewright.data import Landmarks, Scan
from facewright.mesh.adjacency import border_loops
from facewright.mesh.closest import Surface
from facewright.mesh.normals import normalized, vertex_normals
from facewright.packing import pack_face, unpack_face
from facewright.parts import fit_parts
from facewright.register import register
from facewright.scan import clean_scan, find_landmarks
from facewright.template.store import read_template
from facewright.transfer import transfer_shapes

PHONE = ROOT.parent / "shared" / "data" / "rigs" / "arkit-reference" / "arkit_reference.npz"
MEAN_BAR, LEAST_BAR, NAMES_BAR = 0.8, 0.5, 48
MOVES_MM = 0.5
NOT_ICT = ("tongueOut",)  # ICT has none; its template's is made by us
NEAR_MM, FACING = 2.5, 0.3
EYE_LOOP = 24  # vertices around each eye opening of the phone's mesh
SKIN, SCLERA, IRIS, PUPIL = (0.75, 0.55, 0.45), (0.85, 0.85, 0.85), (0.15, 0.10, 0.05), (0.02, 0.02, 0.02)


@dataclass(frozen=True)
class Reference:
    """Somebody else's rig: vertices (n, 3) mm, faces (m, 3), deltas name -> (n, 3) mm; scan to fit the template to,
    in the same frame, its first vertices those of the rig; landmarks on it where they are known."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    deltas: dict
    scan: Scan
    landmarks: Landmarks | None = None


def read_ict(folder):
    """ICT's outer skin; the scan has its eyeballs too, so that lids find what they lie on."""
    ict = read_template(folder)
    kept = ict.regions["outer"].copy()
    for part in ict.parts:
        if part.name in ("eye_left", "eye_right"):
            kept[part.vertex_slice] = True
    chosen = kept[ict.faces].all(axis=1)
    used, faces = np.unique(ict.faces[chosen], return_inverse=True)
    faces = faces.reshape(-1, 3)
    marks = ict.landmarks
    mine = [i for i, name in enumerate(marks.names) if name.startswith("mp")]
    seen = chosen[marks.faces[mine]]
    place = np.where(seen, (np.cumsum(chosen) - 1)[marks.faces[mine]], 0)
    names = tuple(marks.names[i] for i in mine)
    landmarks = Landmarks(names, place, marks.barycentric[mine], marks.weights[mine] * seen)
    vertices = ict.vertices[used]
    skin = faces[(used[faces] < ict.skin.vertices[1]).all(axis=1)]
    deltas = {name: delta[used] for name, delta in zip(ict.shape_names, ict.deltas) if name not in NOT_ICT}
    return Reference("ict", vertices, skin, deltas, Scan(vertices, faces, unit_mm=1.0, name="ict"), landmarks)


def read_phone(path):
    """The phone's own face mesh; the scan has painted eyes in its openings, so that landmarks are found."""
    with np.load(path) as data:
        vertices, faces = 1000.0 * data["vertices_m"].astype(float), data["faces"].astype(int)
        deltas = dict(zip(map(str, data["names"]), 1000.0 * data["deltas_m"].astype(float)))
    points, triangles, colors = [vertices], [faces], [np.tile(SKIN, (len(vertices), 1))]
    for loop in border_loops(faces):
        if len(loop) == EYE_LOOP:
            for store, value in zip((points, triangles, colors), _eye_cap(vertices, loop, sum(map(len, points)))):
                store.append(value)
    scan = Scan(
        np.concatenate(points), np.concatenate(triangles), colors=np.concatenate(colors), unit_mm=1.0, name="phone"
    )
    return Reference("phone", vertices, faces, deltas, scan)


def _eye_cap(vertices, loop, first, radius_mm=12.5, depth_mm=10.0):
    """Points, triangles and colours of a painted ball in an eye opening; new vertices count from first."""
    rim, k = vertices[loop], len(loop)
    middle = rim.mean(axis=0)
    center = middle - [0.0, 0.0, depth_mm]
    shares = np.array([0.75, 0.55, 0.35, 0.18, 0.03])
    flat = middle + shares[:, None, None] * (rim - middle)
    height = shares[:, None] * np.linalg.norm(rim - center, axis=1) + (1 - shares[:, None]) * radius_mm
    rings = (center + normalized((flat - center).reshape(-1, 3)).reshape(flat.shape) * height[..., None]).reshape(-1, 3)
    index = np.concatenate([loop, first + np.arange(len(rings))]).reshape(-1, k)
    after = np.roll(index, -1, axis=1)
    one = np.stack([after[:-1], index[:-1], index[1:]], axis=-1)
    other = np.stack([after[:-1], index[1:], after[1:]], axis=-1)
    away = np.linalg.norm((rings - middle)[:, :2], axis=1)[:, None]
    colors = np.where(away < 2.0, PUPIL, np.where(away < 6.0, IRIS, SCLERA))
    return rings, np.concatenate([one.reshape(-1, 3), other.reshape(-1, 3)]), colors


def fitted(template, reference):
    """The template as a Face on a reference's neutral, and T (4, 4) from the Face's frame to the reference's."""
    digest = fingerprint(template, reference.scan.vertices.tobytes(), reference.scan.faces.tobytes())
    path = CACHE / f"cosines-{reference.name}-{digest}.npz"
    if not path.is_file():
        scan, landmarks = reference.scan, reference.landmarks
        if landmarks is None:
            found = find_landmarks(clean_scan(scan)[0])
            scan, landmarks = found.scan, found.landmarks
        arrays, info = pack_face(fit_parts(register(scan, landmarks, template)))
        CACHE.mkdir(exist_ok=True)
        np.savez(path, T=scan.T_ours_to_scan, info=json.dumps(info), **arrays)
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in stored.files}
    T, info = arrays.pop("T"), json.loads(str(arrays.pop("info")))
    return unpack_face(arrays, info, template), T


class Meeting:
    """A fitted Face and a Reference at points of both: those of the reference's vertices that lie on the face's skin.

    names: the reference's shapes that the template has; ours, theirs (s, k, 3) mm in the reference's frame
    """

    def __init__(self, face, T, reference, deltas):
        template = face.template
        faces = template.faces[template.skin.face_slice]
        faces = faces[template.regions["outer"][faces].all(axis=1)]
        fit = face.fit @ T[:3, :3].T + T[:3, 3]
        used = np.unique(reference.faces)
        points = reference.vertices[used]
        nearest = Surface(fit, faces).closest(points)
        corners, shares = faces[nearest.faces], nearest.barycentric
        facing = np.einsum("kc,kcd->kd", shares, vertex_normals(fit, faces)[corners])
        own = vertex_normals(reference.vertices, reference.faces)[used]
        good = (nearest.distance < NEAR_MM) & ((normalized(facing) * own).sum(axis=1) > FACING)
        self.names = [name for name in template.shape_names if name in reference.deltas]
        self.points, corners, shares = points[good], corners[good], shares[good]
        mine = [template.shape_names.index(name) for name in self.names]
        self.ours = np.einsum("kc,skcd->skd", shares, deltas[mine][:, corners]) @ T[:3, :3].T
        self.theirs = np.stack([reference.deltas[name][used][good] for name in self.names])

    def directions(self):
        """(s,) mean cosine between the directions, weighted by their motion, where theirs is over 0.5 mm."""
        weight = np.linalg.norm(self.theirs, axis=2)
        weight = np.where(weight > MOVES_MM, weight, 0.0)
        cosine = (_unit(self.ours) * _unit(self.theirs)).sum(axis=2)
        return (weight * cosine).sum(axis=1) / np.maximum(weight.sum(axis=1), 1e-12)

    def fields(self):
        """(s, s) cosine of each of our whole fields (row) with each of theirs."""
        ours, theirs = (_unit(fields.reshape(len(fields), -1)) for fields in (self.ours, self.theirs))
        return ours @ theirs.T

    def largest(self):
        """(s, 2) largest motion of ours and theirs in mm."""
        return np.stack([np.linalg.norm(f, axis=2).max(axis=1) for f in (self.ours, self.theirs)], axis=1)


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def carried_shapes(face):
    """(s, n, 3) the template's shapes on a face, those of the eyes by rule, as the main job makes them."""
    return solve_eyes(face, transfer_shapes(face)).deltas


def meet(template, reference):
    face, T = fitted(template, reference)
    return Meeting(face, T, reference, carried_shapes(face))


def report_directions(meeting, verdict):
    """Print the first table."""
    values, largest = meeting.directions(), meeting.largest()
    rows = [(name, value, *most) for name, value, most in zip(meeting.names, values, largest)]
    print_table("Directions beside ICT's", ("shape", "cosine", "largest mm", "ICT's mm"), rows)
    print(f"mean {values.mean():.3f}, least {values.min():.3f} ({meeting.names[int(values.argmin())]})")
    verdict.check("ict", "1 - mean cosine", 1 - values.mean(), 1 - MEAN_BAR)
    verdict.check("ict", "1 - least cosine", 1 - values.min(), 1 - LEAST_BAR)


def report_names(meeting, verdict):
    """Print the second table."""
    cosines, largest = meeting.fields(), meeting.largest()
    rows, own = [], np.diag(cosines)
    for i, name in enumerate(meeting.names):
        order = np.argsort(-cosines[i])
        other = next(j for j in order if j != i)
        rows.append((name, own[i], meeting.names[other], cosines[i, other], order[0] == i, *largest[i]))
    header = ("shape", "own cosine", "next other", "its cosine", "own is nearest", "largest mm", "phone's mm")
    print_table("Nearest of the phone's shapes", header, rows)
    right = sum(bool(row[4]) for row in rows)
    print(f"{right} of {len(rows)} are nearest to their own name")
    verdict.check("phone", "names not met", len(rows) - right, len(rows) - NAMES_BAR)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--template", default="hm08")
    parser.add_argument("--ict", default="ict", help="name or folder of the ICT template")
    parser.add_argument("--phone", type=Path, default=PHONE)
    options = parser.parse_args()
    template, verdict = read_template(options.template), Verdict()
    report_directions(meet(template, read_ict(options.ict)), verdict)
    report_names(meet(template, read_phone(options.phone)), verdict)
    verdict.print()


if __name__ == "__main__":
    main()
