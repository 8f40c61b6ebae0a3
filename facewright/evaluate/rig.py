"""Figures of a finished rig: how far its neutral is from a scan."""

from __future__ import annotations

import numpy as np

from facewright.evaluate.distances import face_to_scan, scan_to_face
from facewright.evaluate.quality import lip_gaps_mm


def measure_rig_distances(rig, scan, *, count=40000):
    """dict region -> {"scan_to_rig", "rig_to_scan"} of the neutral in mm.

    rig a data.Rig, scan a data.Scan in the rig's own frame (our frame, mm)
    """
    meshes = [mesh for mesh in rig.meshes if mesh.name in ("skin", "eye_left", "eye_right")]
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    vertices = np.vstack([mesh.vertices for mesh in meshes])
    faces = np.vstack([mesh.faces + offset for mesh, offset in zip(meshes, offsets)])

    def padded(mask):
        return np.concatenate([mask, np.zeros(len(vertices) - len(mask), bool)])

    regions = {name: padded(rig.regions[name]) for name in ("face", "lips", "eyes") if name in rig.regions}
    if "nostrils" in rig.regions:
        regions["face"] = regions["face"] & ~padded(rig.regions["nostrils"])
    surface = (scan.vertices, scan.faces)
    there = scan_to_face(surface, vertices, faces, regions, count=count)
    back = face_to_scan(surface, vertices, faces, regions, count=count // 2)
    return {name: {"scan_to_rig": there[name], "rig_to_scan": back[name]} for name in regions}


def measure_neutral(rig):
    """dict of the neutral by itself: lip gap in mm, vertices and faces of all meshes."""
    return {
        "lip_gap_mm": float(lip_gaps_mm(rig.meshes[0].vertices, rig.lines).max()),
        "vertices": sum(len(mesh.vertices) for mesh in rig.meshes),
        "faces": sum(len(mesh.faces) for mesh in rig.meshes),
    }


def rig_frame(rig):
    """(4, 4) the scan file's frame to that of the rig's vertices (mm): x_rig = T x_file, from info["T_rig_to_scan"]."""
    T_metres_to_file = np.array(rig.info["T_rig_to_scan"], float)
    return np.linalg.inv(T_metres_to_file @ np.diag([1e-3, 1e-3, 1e-3, 1.0]))
