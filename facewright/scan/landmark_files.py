"""Landmarks as a small JSON that a user can read and edit: name -> [x, y, z] in the coordinates of the scan file.

Names are MediaPipe's "mp0".."mp477", iBUG's "p1".."p68", or a few plain words (NAMED). A point may also be
{"face": index, "barycentric": [a, b, c]} on the cleaned scan.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from facewright.data import Landmarks
from facewright.errors import InputError
from facewright.mesh.closest import Surface
from facewright.scan.landmarks import IBUG68

NAMED = {
    "nose_tip": 4,
    "subnasale": 2,
    "chin": 152,
    "mouth_corner_right": 61,
    "mouth_corner_left": 291,
    "lip_upper": 0,
    "lip_lower": 17,
    "eye_outer_right": 33,
    "eye_inner_right": 133,
    "eye_inner_left": 362,
    "eye_outer_left": 263,
    "nose_wing_right": 64,
    "nose_wing_left": 294,
}


OFF_MM = 12.0
"""A point so far from the surface is a slip: other units, another scan, a digit too many."""


def landmark_index(name):
    """MediaPipe's number of a landmark name; None for an unknown one."""
    if name in NAMED:
        return NAMED[name]
    if name.startswith("mp") and name[2:].isdigit() and int(name[2:]) < 478:
        return int(name[2:])
    if name.startswith("p") and name[1:].isdigit() and 1 <= int(name[1:]) <= 68:
        return IBUG68[int(name[1:]) - 1]
    return None


def read_landmarks(path):
    """dict name -> (3,) point in file coordinates or (face, (3,) barycentric); raises InputError."""
    path = Path(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: this landmark file does not exist; check the name") from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{path.name}: cannot be read as JSON ({error}); correct it") from None
    if not isinstance(content, dict):
        raise InputError(f"{path.name}: holds no {{name: [x, y, z]}} pairs; see docs/input.md")
    return {name: _parsed(path, name, value) for name, value in content.items() if not name.startswith("_")}


def _parsed(path, name, value):
    if landmark_index(name) is None:
        raise InputError(f"{path.name}: unknown landmark {name!r}; give mp0..mp477, p1..p68 or {', '.join(NAMED)}")
    try:
        if isinstance(value, dict):
            face, point = int(value["face"]), np.array(value["barycentric"], dtype=np.float64)
            if abs(point.sum() - 1) > 1e-3 or point.min() < -1e-6:
                raise ValueError("barycentric")
        else:
            face, point = None, np.array(value, dtype=np.float64)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise ValueError("shape")
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"{path.name}: landmark {name!r} is {json.dumps(value)[:60]}; "
            'give [x, y, z] or {"face": index, "barycentric": [a, b, c]}'
        ) from None
    return point if face is None else (face, point)


def write_landmarks(path, landmarks, scan, *, names=None):
    """Write landmarks of a scan in the coordinates of its file, to be moved by hand and given back.

    landmarks Landmarks on the scan's faces
    names     which ones: their names, or landmark name -> the name to write; default all with a weight
    """
    path = Path(path)
    names = names if names is None or isinstance(names, dict) else {name: name for name in names}
    points = landmarks.positions(scan.vertices, scan.faces) @ scan.T_ours_to_scan[:3, :3].T + scan.T_ours_to_scan[:3, 3]
    table = {
        name if names is None else names[name]: [float(f"{value:.7g}") for value in point]
        for name, point, weight in zip(landmarks.names, points, landmarks.weights)
        if weight > 0 and (names is None or name in names)
    }
    lines = ",\n".join(f"  {json.dumps(name)}: {json.dumps(point)}" for name, point in table.items())
    partial = path.with_name(path.name + ".part")
    partial.write_text("{\n" + lines + "\n}\n", encoding="utf-8")
    os.replace(partial, path)


def place_landmarks(landmarks, overrides, scan):
    """Landmarks with those of overrides put where the user says, at the nearest point of the surface, weight 1.

    overrides dict name -> (3,) point in file coordinates or (face, barycentric); scan in our frame
    raises InputError where a point lies far from the surface, or a left one to the right of its twin
    """
    if not overrides:
        return landmarks
    faces, barycentric = landmarks.faces.copy(), landmarks.barycentric.copy()
    weights = landmarks.weights.copy()
    T = np.linalg.inv(scan.T_ours_to_scan)
    surface = Surface(scan.vertices, scan.faces)
    for name, value in overrides.items():
        index = landmark_index(name)
        if isinstance(value, tuple):
            if not 0 <= value[0] < len(scan.faces):
                raise InputError(
                    f"landmark {name!r} lies on face {value[0]}, the cleaned scan has {len(scan.faces)}; correct it"
                )
            faces[index], barycentric[index] = value
        else:
            nearest = surface.closest((T[:3, :3] @ value + T[:3, 3])[None])
            if nearest.distance[0] > OFF_MM:
                raise InputError(
                    f"landmark {name!r} lies {nearest.distance[0]:.0f} mm from the scan; give it in the scan file's "
                    "own coordinates and units"
                )
            faces[index], barycentric[index] = nearest.faces[0], nearest.barycentric[0]
        weights[index] = 1.0
    placed = Landmarks(landmarks.names, faces, barycentric, weights)
    x = np.where(weights > 0.0, placed.positions(scan.vertices, scan.faces)[:, 0], np.nan)
    _check_sides(x, {landmark_index(name) for name in overrides})
    return placed


def _check_sides(x, moved):
    """Raise InputError where a left point lies to the right of its twin; x (478,) to the person's left, nan where it is
    not known; moved: the numbers of points placed by hand."""
    for left, index in NAMED.items():
        right = left.replace("_left", "_right")
        if right != left and {index, NAMED[right]} & moved and x[index] < x[NAMED[right]]:
            raise InputError(
                f"landmark {left!r} lies to the right of {right!r}; left is the person's own left, so swap the two"
            )
