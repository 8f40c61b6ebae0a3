"""Figures of a finished rig: how far its neutral is from a scan."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from facewright.evaluate.distances import face_to_scan, scan_to_face
from facewright.evaluate.eyes import measure_eyes
from facewright.evaluate.mouth import measure_mouth, mouth_poses
from facewright.evaluate.quality import lip_gaps_mm
from facewright.evaluate.shapes import measure_shapes

REPORT_WEIGHTS = (1.0,)  # of each shape, in report.json; `facewright evaluate rig` asks at four


def measure_rig_distances(rig, scan, *, count=40000):
    """dict region -> {"scan_to_rig", "rig_to_scan"} of the neutral in mm.

    rig a data.Rig, scan a data.Scan in the rig's own frame (our frame, mm)
    """
    meshes = [mesh for mesh in rig.meshes if mesh.name == "skin" or mesh.name.startswith(("eye_", "cornea_"))]
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


def measure_rig(rig):
    """dict of what report.json says of a rig, as a player with in-betweens and correctives shows it.

    "contact" name -> {"value", "at"}: lid_gap_mm, lip_gap_mm at rest; blink_gap_mm, mouth_close_gap_mm; penetration_mm,
    the deepest that lids enter eyeballs, lips each other or teeth, teeth the outer skin; "eyes" radius_mm;
    "shapes" as measure_shapes, of the plain shapes
    """
    eyes = measure_eyes(rig, views=False)
    mouth = measure_mouth(rig, mouth_poses(rig, REPORT_WEIGHTS), plain=False)
    blinks = {pose: figures["margins_mm"][0] for pose, figures in eyes["poses"].items() if "margins_mm" in figures}
    depths = {pose: figures["depth_mm"][0] for pose, figures in eyes["poses"].items()}
    depths |= {pose: max(figure[0] for figure in figures.values()) for pose, figures in mouth["poses"].items()}
    contact = {
        "lid_gap_mm": {"value": eyes["lid_gap_mm"], "at": "neutral"},
        "blink_gap_mm": _worst(blinks),
        "lip_gap_mm": {"value": mouth["lip_gap_mm"], "at": "neutral"},
        "penetration_mm": _worst(depths),
    }
    if "mouth_close_gap_mm" in mouth:
        contact["mouth_close_gap_mm"] = {"value": mouth["mouth_close_gap_mm"][0], "at": "jawOpen + mouthClose"}
    return {"contact": contact, "eyes": {"radius_mm": eyes["radius_mm"]}, "shapes": measure_shapes(rig.plain())}


def measure_jaw(rig):
    """dict of how far jawOpen is from the same turn of the jaw bone, in mm, and where the hinge is; None without both.

    teeth_mm largest of the lower teeth; skin_mean_mm, skin_p95_mm over the skin that moves by over 1 mm;
    before_ear_mm: how far the hinge lies in front of the middle of the ears
    """
    turn, lower = rig.info.get("jaw_open_turn_deg"), [mesh for mesh in rig.meshes if mesh.name == "teeth_lower"]
    if turn is None or not lower or lower[0].deltas is None:
        return None
    number, joint = rig.target_names.index("jawOpen"), rig.skeleton.names.index("jaw")
    hinge = rig.skeleton.positions[joint]
    by = Rotation.from_rotvec(turn, degrees=True).as_matrix() - np.eye(3)
    teeth, skin = (
        np.linalg.norm(mesh.skin_weights[:, [joint]] * ((mesh.vertices - hinge) @ by.T) - mesh.deltas[number], axis=1)
        for mesh in (lower[0], rig.meshes[0])
    )
    moves = np.linalg.norm(rig.meshes[0].deltas[number], axis=1) > 1.0
    ears = rig.meshes[0].vertices[rig.regions["ear_left"] | rig.regions["ear_right"]]
    return {
        "teeth_mm": float(teeth.max()),
        "skin_mean_mm": float(skin[moves].mean()),
        "skin_p95_mm": float(np.quantile(skin[moves], 0.95)),
        "before_ear_mm": float(hinge[2] - ears[:, 2].mean()),
    }


def _worst(figures):
    at = max(figures, key=figures.get, default=None)
    return {"value": figures.get(at), "at": at}


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
