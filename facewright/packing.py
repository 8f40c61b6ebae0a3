"""Scan, Landmarks and Face as plain arrays and JSON, for the stage cache: pack_x and unpack_x are inverse."""

from __future__ import annotations

import numpy as np

from facewright.data import Face, Landmarks, Scan

_SCAN_ARRAYS = ("uv", "uv_faces", "face_texture", "colors", "normal_map")


def pack_scan(scan):
    """arrays, info of a Scan."""
    arrays = {"vertices": scan.vertices, "faces": scan.faces, "T_ours_to_scan": scan.T_ours_to_scan}
    arrays.update({name: getattr(scan, name) for name in _SCAN_ARRAYS if getattr(scan, name) is not None})
    arrays.update({f"texture_{i}": image for i, image in enumerate(scan.textures)})
    info = {"unit_mm": scan.unit_mm, "name": scan.name, "notes": list(scan.notes), "textures": len(scan.textures)}
    return arrays, info


def unpack_scan(arrays, info):
    """The Scan of pack_scan."""
    return Scan(
        vertices=arrays["vertices"],
        faces=arrays["faces"],
        T_ours_to_scan=arrays["T_ours_to_scan"],
        textures=tuple(arrays[f"texture_{i}"] for i in range(info["textures"])),
        unit_mm=info["unit_mm"],
        name=info["name"],
        notes=tuple(info["notes"]),
        **{name: arrays[name] for name in _SCAN_ARRAYS if name in arrays},
    )


def pack_landmarks(landmarks):
    """arrays, info of Landmarks."""
    arrays = {"faces": landmarks.faces, "barycentric": landmarks.barycentric, "weights": landmarks.weights}
    return {f"landmark_{name}": value for name, value in arrays.items()}, {"landmark_names": list(landmarks.names)}


def unpack_landmarks(arrays, info):
    """The Landmarks of pack_landmarks."""
    return Landmarks(
        tuple(info["landmark_names"]),
        arrays["landmark_faces"],
        arrays["landmark_barycentric"],
        arrays["landmark_weights"],
    )


def pack_face(face):
    """arrays, info of a Face, without its template."""
    arrays = {"vertices": face.vertices, "fit": face.fit, "observed": face.observed}
    arrays.update({f"region_{name}": mask for name, mask in face.regions.items()})
    arrays.update({f"line_{name}": line for name, line in face.lines.items()})
    return arrays, {"expression": face.expression, "eyes_closed": face.eyes_closed, "stats": face.stats}


def unpack_face(arrays, info, template):
    """The Face of pack_face."""
    return Face(
        template=template,
        vertices=arrays["vertices"],
        fit=arrays["fit"],
        regions={name[7:]: value for name, value in arrays.items() if name.startswith("region_")},
        lines={name[5:]: np.asarray(value) for name, value in arrays.items() if name.startswith("line_")},
        observed=arrays["observed"],
        expression=info["expression"],
        eyes_closed=info["eyes_closed"],
        stats=info["stats"],
    )
