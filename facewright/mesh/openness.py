"""How open to the outside a surface is: mouth bags, eye pouches and nostrils are dark, cheeks are bright."""

import numpy as np

from facewright.mesh.normals import vertex_normals
from facewright.mesh.raster import RayScene

GRAZING = 0.1  # cosine below which a direction is left out: there the mesh's own facets cast false shadows


def sphere_directions(count):
    """(count, 3) unit vectors spread evenly (a Fibonacci spiral)."""
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    angle = np.pi * (1.0 + np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def vertex_openness(vertices, faces, *, n_directions=128, offset_mm=0.05, subset=None, scene=None):
    """(n,) in 0..1: the share of directions of a vertex's hemisphere that reach the outside; 0 without faces.

    vertices (n, 3) mm, faces (m, 3), everything that casts shadows; n_directions over the whole sphere, so that
    about half of them count per vertex; offset_mm lifts the origins off the surface
    subset (k,) indices: only these vertices are asked, and (k,) values come back
    scene  the mesh's raster.RayScene, from whoever has it already
    """
    normals = vertex_normals(vertices, faces)
    scene = RayScene(vertices, faces) if scene is None else scene
    if subset is not None:
        vertices, normals = vertices[subset], normals[subset]
    origins = vertices + offset_mm * normals
    free, total = np.zeros(len(vertices)), np.zeros(len(vertices))
    for direction in sphere_directions(n_directions):
        facing = np.flatnonzero(normals @ direction > GRAZING)
        if len(facing):
            hidden = scene.occluded(origins[facing], np.broadcast_to(direction, (len(facing), 3)))
            free[facing] += ~hidden
            total[facing] += 1
    return np.divide(free, total, out=np.zeros(len(vertices)), where=total > 0)
