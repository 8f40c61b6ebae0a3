"""Laplacians of a triangle mesh, positive semidefinite."""

import igl
import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import vertex_adjacency


def cotangent_laplacian(V, F):
    """(n, n) csr, positive semidefinite; row sums 0. Negative weights are possible at obtuse triangles."""
    return (-igl.cotmatrix(np.ascontiguousarray(V), np.ascontiguousarray(F))).tocsr()


def uniform_laplacian(F, n):
    """(n, n) csr graph Laplacian D - A."""
    A = vertex_adjacency(F, n)
    return sp.diags(np.asarray(A.sum(axis=1)).ravel()) - A


def lumped_mass(V, F):
    """(n,) barycentric vertex areas, mm2."""
    areas = 0.5 * igl.doublearea(np.ascontiguousarray(V), np.ascontiguousarray(F)) / 3.0
    return np.bincount(F.ravel(), weights=np.repeat(areas, 3), minlength=len(V))
