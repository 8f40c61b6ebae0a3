"""MeshMonk 0.3.0 (pip install meshmonk==0.3.0) with its documented defaults, started from our similarity.

It gets the outer skin only: the inside of mouth and sockets would be torn out by its nearest neighbours.
"""

from __future__ import annotations

import time

import numpy as np

from facewright.mesh.normals import vertex_normals


def is_available():
    """Whether the package is installed."""
    try:
        import meshmonk  # noqa: F401
    except ImportError:
        return False
    return True


def run_meshmonk(template, T, scan):
    """(n, 3) fitted vertices in the scan's frame and the seconds it took.

    T (4, 4) similarity of the template to the scan's frame; vertices outside the outer skin stay where T puts them
    """
    import meshmonk

    meshmonk.set_log_level("error")
    start = template.vertices @ T[:3, :3].T + T[:3, 3]
    outer = np.flatnonzero(template.regions["outer"])
    number = np.full(len(start), -1)
    number[outer] = np.arange(len(outer))
    faces = template.faces[template.skin.face_slice]
    faces = number[faces[template.regions["outer"][faces].all(axis=1)]]
    began = time.perf_counter()
    result = meshmonk.pyramid_register(
        floating_features=_features(start[outer], faces),
        target_features=_features(scan.vertices, scan.faces),
        floating_faces=faces.astype(np.int32),
        target_faces=scan.faces.astype(np.int32),
        floating_flags=np.ones(len(outer), np.float32),
        target_flags=np.ones(len(scan.vertices), np.float32),
    )
    seconds = time.perf_counter() - began
    fitted = start.copy()
    fitted[outer] = result.aligned_vertices
    return fitted, seconds


def _features(vertices, faces):
    """(n, 6) positions and normals."""
    return np.ascontiguousarray(np.hstack([vertices, vertex_normals(vertices, faces)]), dtype=np.float32)
