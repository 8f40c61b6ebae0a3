"""find_landmarks: where the face is on a scan, which way it looks, how large its unit is, and whether its texture
coordinates stand upright. The answer is a scan in our frame with landmarks on its faces.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from facewright.conventions import INTERPUPILLARY_MM, MM_PER_UNIT
from facewright.data import Landmarks, Scan
from facewright.errors import InputError
from facewright.scan.clean import far_components, keep_faces, turn_faces
from facewright.scan.detector import LANDMARK_NAMES
from facewright.scan.landmark_files import landmark_index, place_landmarks
from facewright.scan.landmarks import (
    EYE_LEFT,
    EYE_RIGHT,
    LIPS_INNER,
    LIPS_OUTER,
    NOSE,
    STABLE,
    VIEWS,
    face_cameras,
    fuse_sightings,
)
from facewright.scan.orientation import BELIEVED_MM, DOUBTFUL_MM, fit_canonical, search_faces, search_frame
from facewright.scan.sightings import (
    CLAY_LOOKS,
    Subject,
    join_sightings,
    sight_landmarks,
    transform,
    worn_looks,
)

# What five views must agree on (mean weight of the stable landmarks), also where the face is not one of the usual: on a
# man with narrow eyes and a long way to thick lips, 6.5 mm from the canonical face, they agree on 0.86 and more.
AGREED, AGREED_WHOLLY = 0.4, 0.75
QUICK_VIEWS = ((-20.0, 0.0), (0.0, -15.0), (0.0, 0.0), (0.0, 15.0), (20.0, 0.0))
FLIP_VIEWS = ((-15.0, 0.0), (0.0, 0.0), (15.0, 0.0))
# A human head's distance between the pupils lies within these, mm; outside the second pair a unit is mistaken: inches
# for centimetres put the eyes of a small head 114 mm apart, centimetres for inches those of a large one 30.
PLAUSIBLE_IPD_MM = (45.0, 75.0)
POSSIBLE_IPD_MM = (30.0, 110.0)
# Pieces further than this from every landmark are no part of the head, mm.
HEAD_REACH_MM = 150.0
# Edges of a mesh this long within this distance from between the eyes are facets that one sees, mm.
COARSE_MM, FACE_REACH_MM = 3.0, 90.0
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}


@dataclass(frozen=True)
class LandmarkOptions:
    """How find_landmarks reads a scan.

    up         axis of the file that points up: "x", "y", "z", "-x", "-y" or "-z"; None: found
    units      "mm", "cm", "dm", "m", "inch": the file's unit; None: the format's, else found
    mirror     the scan is a mirror image: turn it back (never done unasked)
    landmarks  name -> (3,) point in file coordinates or (face, barycentric), as read_landmarks gives; these win
    """

    up: str | None = None
    units: str | None = None
    mirror: bool = False
    landmarks: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class FoundFace:
    """A scan in our frame with its landmarks.

    scan             in our frame, mm; texture coordinates turned upright; T_ours_to_scan leads back to the file
    landmarks        "mp0".."mp477" on scan.faces
    T_scan_to_ours   (4, 4) similarity: x_ours = T x_file (mirroring only where options.mirror says so)
    unit_mm          millimetres per unit of the file
    unit_source      "given", "format", "found" or "assumed"
    uv_flipped       the file's V ran downward and was turned
    warnings         sentences for the report
    stats            residual_mm against the canonical face, ipd_mm, agreement of the views, and the like
    """

    scan: Scan
    landmarks: Landmarks
    T_scan_to_ours: np.ndarray
    unit_mm: float
    unit_source: str
    uv_flipped: bool
    warnings: tuple[str, ...]
    stats: dict[str, Any]


def find_landmarks(scan, options=LandmarkOptions()):
    """The face on a clean scan (see clean_scan): FoundFace.

    Any orientation, position and unit, textured, coloured or in clay; the result does not depend on them.
    raises InputError where there is no face
    """
    _check_options(options)
    scan = _mirrored(scan) if options.mirror else scan
    to_search = search_frame(scan.vertices, scan.faces)
    subject = Subject.of(transform(to_search, scan.vertices), scan.faces, reach=1.0)
    T, warnings = _stand_up(scan, subject, to_search, options)
    subject = subject.shaded_over(2.0 / np.cbrt(np.linalg.det(T[:3, :3])))
    flipped = _is_upside_down(scan, subject, T)
    if flipped:
        scan = _with_uv_flipped(scan)
        warnings.append("the texture was upside down (V of the file runs downward); it was turned")
    wardrobe = _closer_looks(scan, transform(T, subject.vertices))
    for views in (QUICK_VIEWS, VIEWS):
        landmarks, guess = _look(subject, T, wardrobe, views)
        T = guess.T if landmarks.weights.any() else T
    landmarks = place_landmarks(landmarks, options.landmarks, scan)
    guess = fit_canonical(landmarks.positions(scan.vertices, scan.faces), landmarks.weights)
    T = guess.T
    ipd = _pupil_distance(scan, landmarks)
    unit_mm, source, more = choose_unit(ipd, scan.unit_mm, options.units)
    T = _rescaled(T, unit_mm)
    aligned = scan.transformed(T)
    stats = {
        "residual_mm": guess.residual_mm,
        "ipd_mm": float(ipd * unit_mm),
        "agreement": float(landmarks.weights[list(STABLE)].mean()),
    }
    aligned, landmarks, dropped = _head_only(aligned, landmarks)
    if dropped:
        more = [*more, f"dropped pieces of {dropped} faces far from the face"]
    to_ours = np.linalg.inv(aligned.T_ours_to_scan)
    return FoundFace(aligned, landmarks, to_ours, unit_mm, source, flipped, tuple(warnings + more), stats)


def _check_options(options):
    if options.up is not None and options.up.lower() not in AXES:
        raise InputError(f"unknown up axis {options.up!r}; give one of {', '.join(AXES)}")
    if options.units is not None and options.units not in MM_PER_UNIT:
        raise InputError(f"unknown unit {options.units!r}; give one of {', '.join(MM_PER_UNIT)}")


def _mirrored(scan):
    turned = turn_faces(scan.transformed(np.diag([-1.0, 1.0, 1.0, 1.0])), np.ones(len(scan.faces), bool))
    return replace(turned, notes=(*turned.notes, "mirrored as asked"))


def wardrobe_of(scan):
    """The Looks in which a scan is shown to the landmarker: as it is, if it has texture or colours, and in clay."""
    looks = worn_looks(scan)
    return [CLAY_LOOKS] if looks is None else [looks, CLAY_LOOKS]


def face_edge_mm(vertices, faces):
    """Median length of a head mesh's edges in the face, mm: vertices (n, 3) in about our frame, faces (m, 3)."""
    faces = faces[np.linalg.norm(vertices[faces[:, 0]], axis=1) < FACE_REACH_MM]
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    return float(np.median(edges)) if len(edges) else 0.0


def _closer_looks(scan, vertices):
    """The wardrobe for the last looks; vertices (n, 3) of the scan in about our frame.

    In clay a coarse mesh shows its facets: where it has a photograph, that alone is looked at (a scan cut to 3,000
    triangles: landmarks 0.9 mm from the full scan's, 1.3 with the clay).
    """
    wardrobe = wardrobe_of(scan)
    return wardrobe[:1] if face_edge_mm(vertices, scan.faces) > COARSE_MM else wardrobe


def _stand_up(scan, subject, to_search, options):
    """T (4, 4) that roughly brings the subject into our frame at 63 mm between the eyes, and warnings."""
    up = None if options.up is None else np.array(AXES[options.up.lower()], float) * [-1 if options.mirror else 1, 1, 1]
    doubtful = []
    for looks in reversed(wardrobe_of(scan)):  # clay first: it cannot lie upside down
        for guess in search_faces(subject, looks, up=up):
            if guess.residual_mm > BELIEVED_MM:
                doubtful.append((guess, looks))
            elif (sure := _confirmed(subject, looks, guess)) is not None:
                return sure[0], []
    warnings = ["the face was hard to find; check the landmarks"]
    by_hand = _stand_by_hand(scan, options.landmarks)
    if by_hand is not None:
        return by_hand @ np.linalg.inv(to_search), warnings
    doubtful.sort(key=lambda entry: entry[0].residual_mm)
    for guess, looks in doubtful[:4]:
        if (sure := _confirmed(subject, looks, guess)) is not None:
            return sure[0], [] if sure[1] >= AGREED_WHOLLY else warnings
    raise InputError(
        f"{scan.name}: no face was found on it; check that it is a head (of a whole body, cut the head out), or give "
        "the corners of both eyes and of the mouth with --landmarks"
    )


def _stand_by_hand(scan, overrides):
    """T (4, 4) from the scan's frame to ours by the user's landmarks, if they show both eyes and the mouth or nose."""
    points, weights = np.zeros((len(LANDMARK_NAMES), 3)), np.zeros(len(LANDMARK_NAMES))
    to_now = np.linalg.inv(scan.T_ours_to_scan)
    for name, value in overrides.items():
        index = landmark_index(name)
        if index in STABLE:
            point = value[1] @ scan.vertices[scan.faces[value[0]]] if isinstance(value, tuple) else value
            points[index] = point if isinstance(value, tuple) else transform(to_now, point[None])[0]
            weights[index] = 1.0
    enough = all(weights[list(group)].any() for group in (EYE_LEFT, EYE_RIGHT, LIPS_OUTER + LIPS_INNER + NOSE))
    return fit_canonical(points, weights).T if enough and weights.sum() >= 4 else None


def _confirmed(subject, looks, guess):
    """The frame (4, 4) of a guess after a second look from five sides, and how far these agree; None where they do not
    agree on a face.
    """
    landmarks, found = _look(subject, guess.T, [looks], QUICK_VIEWS, may_miss=1)
    if landmarks is None:
        return None
    agreement = landmarks.weights[list(STABLE)].mean()
    strange = found.residual_mm > BELIEVED_MM
    if found.residual_mm > DOUBTFUL_MM or agreement < (AGREED_WHOLLY if strange else AGREED):
        return None
    turn = guess.T[:3, :3] @ found.T[:3, :3].T
    cosine = (np.trace(turn) / np.cbrt(np.linalg.det(turn)) - 1) / 2
    return (found.T, agreement) if cosine > np.cos(np.radians(35.0)) else None


def _look(subject, T, wardrobe, views, *, may_miss=None):
    """Landmarks from views about the face that stands in the frame T, and the Guess they give; None, None where more
    than may_miss views find no face.
    """
    sightings = join_sightings(sight_landmarks(subject, T, wardrobe, face_cameras(views)))
    if may_miss is not None and sightings.missed > may_miss:
        return None, None
    landmarks = fuse_sightings(subject, T, sightings)
    return landmarks, fit_canonical(landmarks.positions(subject.vertices, subject.faces), landmarks.weights)


def _is_upside_down(scan, subject, T):
    """Whether the texture fits the shape only with V turned: its landmarks are held against the clay's.

    The pictures are unlit, so that nothing but the texture speaks.
    """
    if not scan.has_texture:
        return False
    wardrobe = [CLAY_LOOKS, worn_looks(scan), worn_looks(_with_uv_flipped(scan))]
    clay, upright, turned = sight_landmarks(subject, T, wardrobe, face_cameras(FLIP_VIEWS), unlit=True)
    if not len(clay.points):
        return False
    stable = list(STABLE)
    reference = np.median(clay.points, axis=0)[stable]

    def misfit(sightings):
        if sightings.missed:
            return np.inf
        return float(np.median(np.linalg.norm(np.median(sightings.points, axis=0)[stable] - reference, axis=1)))

    return misfit(turned) < 0.5 * misfit(upright)


def _with_uv_flipped(scan):
    return replace(scan, uv=scan.uv * [1.0, -1.0] + [0.0, 1.0])


def _pupil_distance(scan, landmarks):
    """Distance between the middles of the two eyes, in the scan's present unit.

    The middle of an eye is that of the 16 points about it: of heads turned at random it differs by 0.05 % from run to
    run, the middle of the canthi by 0.3 %, the iris by 0.4 % (worse where the eyes are closed).
    """
    points, known = landmarks.positions(scan.vertices, scan.faces), landmarks.weights > 0.0
    left, right = (points[[i for i in eye if known[i]] or list(eye)].mean(axis=0) for eye in (EYE_LEFT, EYE_RIGHT))
    return float(np.linalg.norm(left - right))


def choose_unit(ipd, format_mm=None, given=None):
    """Millimetres per unit of a file in which the eyes are ipd units apart: (unit_mm, source, warnings).

    given, the user's word for it, is believed unless it is far from a human head; format_mm is believed if it makes
    one; else the unit among mm, cm, dm, m and inch that does; else 63 mm between the eyes.
    raises InputError for a given unit that cannot be
    """
    low, high = PLAUSIBLE_IPD_MM
    fitting = {name: value for name, value in MM_PER_UNIT.items() if low <= ipd * value <= high}
    if given is not None:
        apart = ipd * MM_PER_UNIT[given]
        if POSSIBLE_IPD_MM[0] <= apart <= POSSIBLE_IPD_MM[1]:
            return MM_PER_UNIT[given], "given", []
        advice = "no unit makes them human, so leave it out"
        for name, value in fitting.items():
            advice = f"--units {name} would put them {ipd * value:.0f} mm apart"
        raise InputError(f"--units {given} would put the eyes {round(apart, 2):,g} mm apart; {advice}")
    if format_mm is not None and low <= ipd * format_mm <= high:
        return format_mm, "format", []
    warnings = []
    if format_mm is not None:
        warnings.append(f"the format's unit would put the eyes {ipd * format_mm:.4g} mm apart; it was not believed")
    if fitting:
        return min(fitting.values(), key=lambda value: abs(ipd * value - INTERPUPILLARY_MM)), "found", warnings
    warnings.append("no unit makes this a human head; it was scaled to 63 mm between the eyes")
    return INTERPUPILLARY_MM / ipd, "assumed", warnings


def _rescaled(T, unit_mm):
    """T with another scale; what lies at our origin stays there."""
    scale = np.cbrt(np.linalg.det(T[:3, :3]))
    scaled = T.copy()
    scaled[:3] *= unit_mm / scale
    return scaled


def _head_only(scan, landmarks):
    """The scan and its landmarks without pieces far from the face, and how many faces went."""
    used = landmarks.weights > 0
    far = far_components(scan, landmarks.positions(scan.vertices, scan.faces)[used], reach=HEAD_REACH_MM)
    if not far.any():
        return scan, landmarks, 0
    place = np.maximum(np.cumsum(~far) - 1, 0)  # landmarks without weight may lie on what goes
    kept = replace(landmarks, faces=place[landmarks.faces])
    return keep_faces(scan, ~far), kept, int(far.sum())
