"""MediaPipe's face landmarker on one picture, and its canonical face: the only module that knows MediaPipe.

The model file lies beside this module with its notice (Apache-2.0). Nothing is downloaded.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.machinery
import importlib.util
import os
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np

from facewright.conventions import INTERPUPILLARY_MM
from facewright.mesh.normals import vertex_normals

MODEL_PATH = Path(__file__).with_name("face_landmarker.task")
N_LANDMARKS = 478
LANDMARK_NAMES = tuple(f"mp{i}" for i in range(N_LANDMARKS))

# Outer and inner canthi in MediaPipe's numbering, the person's right eye first.
CANTHI_RIGHT, CANTHI_LEFT = (33, 133), (263, 362)
# From the middle of the four canthi to the middle of the eyeballs, mm at an inter-pupillary distance of 63 mm, when
# lips, eyes and nose are laid on the canonical face: measured on two head templates whose eyeballs are known.
CANTHI_TO_EYES_MM = (0.0, 2.8, -11.2)


@contextlib.contextmanager
def _quiet_stderr():
    """Point the process's stderr to nowhere: MediaPipe's C++ threads log start-up chatter that no flag turns off."""
    sys.stderr.flush()
    try:
        saved = os.dup(2)
    except OSError:  # no stderr at all, as under pythonw
        yield
        return
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(sink)
        os.close(saved)


class _Lazily:
    """Lets a module be imported without running it until it is used: MediaPipe's import asks for pyplot, which takes
    longer than all the rest of it and is for drawings that nobody asks for here.
    """

    def __init__(self, name):
        self.name = name

    def find_spec(self, name, path=None, target=None):
        """As importlib.abc.MetaPathFinder has it."""
        spec = importlib.machinery.PathFinder.find_spec(name, path) if name == self.name else None
        if spec is not None and spec.loader is not None:
            spec.loader = importlib.util.LazyLoader(spec.loader)
        return spec

    def __enter__(self):
        sys.meta_path.insert(0, self)

    def __exit__(self, *_):
        sys.meta_path.remove(self)


@functools.lru_cache(maxsize=1)
def _landmarker():
    """The network, loaded once a process, and its image class. About 0.4 s after an import of about 0.6 s."""
    with _quiet_stderr(), _Lazily("matplotlib.pyplot"):
        import mediapipe

        vision = mediapipe.tasks.vision
        options = vision.FaceLandmarkerOptions(
            base_options=mediapipe.tasks.BaseOptions(model_asset_buffer=MODEL_PATH.read_bytes()),
            num_faces=1,
            min_face_detection_confidence=0.3,
            min_face_presence_confidence=0.3,
        )
        landmarker = vision.FaceLandmarker.create_from_options(options)
        # The first picture draws the rest of the chatter.
        blank = np.zeros((64, 64, 3), np.uint8)
        landmarker.detect(mediapipe.Image(image_format=mediapipe.ImageFormat.SRGB, data=blank))
    return landmarker, functools.partial(mediapipe.Image, image_format=mediapipe.ImageFormat.SRGB)


def detect_landmarks(image):
    """The most prominent face in a picture (h, w, 3) uint8 sRGB.

    returns (478, 2) pixels (x right, y down, pixel centres at .5), or None where no face is seen
    """
    landmarker, as_image = _landmarker()
    height, width = image.shape[:2]
    found = landmarker.detect(as_image(data=np.ascontiguousarray(image))).face_landmarks
    if not found:
        return None
    pixels = np.array([(point.x, point.y) for point in found[0]])
    return pixels * [width, height]


def detect_both_ways(image):
    """(478, 2) pixels, the mean of the picture's landmarks and of its mirror image's; None if either has no face.

    That halves the network's noise, and makes the result commute with mirroring the head: what is left of the
    network's bias is the same on both sides.
    """
    found = detect_landmarks(image)
    mirrored = detect_landmarks(image[:, ::-1])
    if found is None or mirrored is None:
        return None
    mirrored = mirrored[mirrored_landmarks()] * [-1, 1] + [image.shape[1], 0]
    return (found + mirrored) / 2


def _protobuf_fields(message):
    """(field number, value) pairs of a protobuf message: ints, float32s and bytes."""

    def varint(at):
        value = shift = 0
        while True:
            byte = message[at]
            value |= (byte & 127) << shift
            shift, at = shift + 7, at + 1
            if byte < 128:
                return value, at

    at = 0
    while at < len(message):
        key, at = varint(at)
        if key & 7 == 0:
            value, at = varint(at)
        elif key & 7 == 5:
            value, at = struct.unpack_from("<f", message, at)[0], at + 4
        else:
            size, at = varint(at)
            value, at = message[at : at + size], at + size
        yield key >> 3, value


@functools.lru_cache(maxsize=1)
def _canonical_mesh():
    """Positions (468, 3) in MediaPipe's own frame (cm, +Y up, +Z out) and triangles (m, 3)."""
    with zipfile.ZipFile(MODEL_PATH) as bundle:
        metadata = bundle.read("geometry_pipeline_metadata_landmarks.binarypb")
    mesh = list(_protobuf_fields(dict(_protobuf_fields(metadata))[1]))
    buffer = np.array([value for number, value in mesh if number == 3])
    triangles = np.array([value for number, value in mesh if number == 4], dtype=np.int64)
    return buffer.reshape(-1, 5)[:, :3], triangles.reshape(-1, 3)  # position and texture coordinates, interleaved


@functools.lru_cache(maxsize=1)
def canonical_landmarks():
    """(468, 3) MediaPipe's canonical face in our frame: mm, 63 mm between the eyes, origin between the eyeballs.

    The distance is that of the middles of the canthi. The irises (468..477) are no part of it.
    """
    points = _canonical_mesh()[0]
    right, left = points[list(CANTHI_RIGHT)].mean(axis=0), points[list(CANTHI_LEFT)].mean(axis=0)
    points = (points - (right + left) / 2) * (INTERPUPILLARY_MM / np.linalg.norm(left - right))
    points = points - np.array(CANTHI_TO_EYES_MM)
    points.flags.writeable = False
    return points


@functools.lru_cache(maxsize=1)
def canonical_normals():
    """(478, 3) unit normals of the canonical face; the irises look straight ahead."""
    normals = np.tile([0.0, 0.0, 1.0], (N_LANDMARKS, 1))
    normals[:468] = vertex_normals(*_canonical_mesh())
    normals.flags.writeable = False
    return normals


@functools.lru_cache(maxsize=1)
def mirrored_landmarks():
    """(478,) index of each landmark's twin on the other side of the face."""
    canonical = canonical_landmarks()
    gaps = np.linalg.norm(canonical[:, None] * [-1, 1, 1] - canonical[None], axis=2)
    twins = np.arange(N_LANDMARKS)
    twins[: len(canonical)] = gaps.argmin(axis=1)
    # Irises: centre, then the points towards the person's left, up, right and down.
    twins[468:] = [473, 476, 475, 474, 477, 468, 471, 470, 469, 472]
    return twins
