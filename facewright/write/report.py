"""report.json: what was found, repaired, fitted and removed. Every figure comes from evaluate/."""

from __future__ import annotations

import importlib.metadata
import json
import math
import sys

import numpy as np

from facewright import __version__
from facewright.evaluate.distances import measure_distances
from facewright.evaluate.quality import measure_quality
from facewright.evaluate.seam import measure_seam
from facewright.evaluate.symmetry import measure_symmetry
from facewright.write.files import replace_file

PACKAGES = ("numpy", "scipy", "cholespy", "libigl", "embreex", "pillow", "mediapipe")


def build_report(scan, face, rig, clean_stats, pose_info):
    """The report as a dict, without times and memory.

    scan in our frame, face data.Face, rig data.Rig, clean_stats of clean_scan, pose_info of find_landmarks
    """
    shown = face.regions["face"] & ~face.regions["hidden"]
    hidden_share = 1.0 - shown.sum() / max(face.regions["face"].sum(), 1)
    registration = measure_distances(scan, face.fit, face.template, face.regions | {"face": shown})
    registration["hidden_share"] = hidden_share
    for figures in (registration["scan_to_face_mm"], registration["face_to_scan_mm"]):
        figures["left_out"] = 1.0 - (1.0 - figures["left_out"]) * (1.0 - hidden_share)
    registration |= measure_quality(scan, face.fit, face.template, face.regions, face.lines)
    registration |= measure_seam(scan, face.fit, face.lines)
    registration["landmark_mm"] = face.stats["landmark_mm"]
    registration["model"] = {key: face.stats[key] for key in ("model_rms_mm", "identity_std", "landmarks_used")}
    return {
        "format": 1,
        "facewright": __version__,
        "versions": {name: _version(name) for name in PACKAGES} | {"python": sys.version.split()[0]},
        "template": {key: face.template.info.get(key) for key in ("name", "version", "topology_id")},
        "scan": {"vertices": len(scan.vertices), "faces": len(scan.faces), "textured": scan.has_texture},
        "cleaning": clean_stats,
        "pose": pose_info,
        "registration": registration,
        "neutral": neutral_changes(face),
        "parts": face.stats.get("parts", {}),
        "eyes_closed_on_scan": face.eyes_closed,
        "expression_removed": face.expression,
        "expression_found": face.stats["expression_found"],
        "symmetry_mm": measure_symmetry(face.vertices, face.template.mirror, face.regions),
        "T_rig_to_scan": rig.info["T_rig_to_scan"],
        "targets": len(rig.target_names),
        "warnings": warnings(scan, face, registration, clean_stats, pose_info),
    }


def neutral_changes(face):
    """How far the rig's neutral is from the fit: outside eyes and lips, and the largest removal with its region."""
    moved = np.linalg.norm(face.vertices - face.fit, axis=1)
    regions = face.regions
    outside = regions["face"] & ~regions["eyes"] & ~regions["lips"]
    outer = np.flatnonzero(regions["outer"])
    worst = outer[moved[outer].argmax()]
    names = ("eyes", "lips", "nostrils", "face", "scalp", "neck")
    where = next((name for name in names if name in regions and regions[name][worst]), "outer")
    return {
        "face_outside_eyes_and_lips_mean_mm": float(moved[outside].mean()),
        "face_outside_eyes_and_lips_max_mm": float(moved[outside].max()),
        "largest_mm": float(moved[worst]),
        "largest_region": where,
    }


def warnings(scan, face, registration, clean_stats, pose_info):
    """Sentences a user should read: doubt is said, never hidden."""
    notes = [*scan.notes, *pose_info.get("notes", ())]
    notes = list(dict.fromkeys(notes))
    shut = [side for side, closed in face.eyes_closed.items() if closed]
    if shut:
        how = "opened to the template's aperture" if face.expression else "left closed"
        notes.append(f"eyes closed on the scan ({', '.join(shut)}): {how}")
    removed = {name: weight for name, weight in face.expression.items() if not name.startswith("eyeBlink")}
    if removed:
        listed = ", ".join(f"{name} {weight:.2f}" for name, weight in removed.items())
        notes.append(f"expression taken out of the neutral: {listed}")
    if not face.stats.get("lips_closed", True):
        notes.append("no crease between the lips was found on the scan: the mouth follows the model, look at it")
    if registration["scan_to_face_mm"]["p95"] is not None and registration["scan_to_face_mm"]["p95"] > 1.0:
        notes.append(
            f"the fit is poor: 5 % of the face are over {registration['scan_to_face_mm']['p95']:.1f} mm from the scan; "
            "move landmarks with --landmarks"
        )
    if registration["hidden_share"] > 0.01:
        notes.append(
            f"{registration['hidden_share']:.0%} of the face are hidden by hair or cloth, or missing: there "
            "it follows the model and is left out of the figures"
        )
    folded = registration["folded"] - registration["folded_hidden"]
    if folded:
        notes.append(f"{folded} faces of the fit are folded")
    return notes


def write_json(document, path):
    """Write JSON with sorted keys and finite numbers only."""
    replace_file(path, (json.dumps(plain(document), indent=1, sort_keys=True) + "\n").encode())


def plain(value):
    """A value as JSON knows it: numpy as numbers and lists, figures with 9 digits, infinite ones None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.9g}") if math.isfinite(value) else None
    return value


def _version(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
