"""Errors against a known truth: where every vertex should be, and the surface without noise.

Surface distance cannot see sliding: a fit may lie on the scan everywhere and have its mouth corner on the cheek. So
registration is tuned on these figures, from synthetic scans (evaluate/synthetic.py).
"""

from __future__ import annotations

import numpy as np

from facewright.evaluate.distances import summary, surface_faces
from facewright.mesh.closest import Surface
from facewright.mesh.sampling import sample_surface

REGIONS = ("face", "lips", "eyes", "nostrils")


def vertex_errors(fit, truth, regions, *, scale=1.0, names=REGIONS):
    """dict region -> summary of |fit - truth| over its vertices; fit, truth (n, 3); nostrils are no part of `face`."""
    distance = np.linalg.norm(fit - truth, axis=1) * scale
    masks = {name: regions[name] for name in names if name in regions}
    if "face" in masks and "nostrils" in regions:
        masks["face"] = masks["face"] & ~regions["nostrils"]
    return {name: summary(distance[mask]) for name, mask in masks.items()}


def surface_errors(fit, template, true_surface, regions=None, *, scale=1.0, count=20000):
    """summary of the distance from area-even points of the fit's region `face` to the noise-free surface.

    fit (n, 3); true_surface (vertices, faces) without noise, hole or clutter
    """
    regions = template.regions if regions is None else regions
    faces = template.faces[surface_faces(template)]
    asked = regions["face"] & ~regions["nostrils"]
    samples = sample_surface(fit, faces, count, asked[faces].all(axis=1))
    return summary(Surface(*true_surface).closest(samples.points).distance * scale)


def along_and_across(fit, truth, normals, mask):
    """Mean sliding and mean depth error of masked vertices: (tangential mm, normal mm); normals (n, 3) of the truth."""
    difference = (fit - truth)[mask]
    depth = (difference * normals[mask]).sum(axis=1)
    sliding = np.linalg.norm(difference - depth[:, None] * normals[mask], axis=1)
    return float(sliding.mean()), float(np.abs(depth).mean())
