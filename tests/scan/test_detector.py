"""The canonical face, and that the network comes up quietly without a download."""

import subprocess
import sys

import numpy as np

from facewright.scan import detector


def test_canonical_face_stands_in_our_frame():
    points = detector.canonical_landmarks()
    left, right = points[list(detector.CANTHI_LEFT)].mean(axis=0), points[list(detector.CANTHI_RIGHT)].mean(axis=0)
    assert np.allclose(left - right, [63, 0, 0])
    assert points[4, 2] > 40 and points[152, 1] < -80 and points[263, 0] > 0  # nose, chin, the person's left eye


def test_canonical_face_is_its_own_mirror_image():
    twins, points = detector.mirrored_landmarks(), detector.canonical_landmarks()
    assert np.array_equal(twins[twins], np.arange(478))
    assert np.allclose(points[twins[:468]], points * [-1, 1, 1])
    normals = detector.canonical_normals()
    assert np.allclose(np.linalg.norm(normals, axis=1), 1) and normals[:, 2].mean() > 0.5
    assert np.allclose(normals[twins], normals * [-1, 1, 1], atol=1e-6)


def test_no_face_no_landmarks():
    assert detector.detect_landmarks(np.zeros((96, 96, 3), np.uint8)) is None
    assert detector.detect_both_ways(np.full((96, 96, 3), 200, np.uint8)) is None


def test_stderr_stays_clean():
    code = (
        "import sys, numpy as np\n"
        "from facewright.scan.detector import detect_landmarks\n"
        "detect_landmarks(np.zeros((96, 96, 3), np.uint8))\n"
        "sys.stderr.write('still here')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "still here" and done.stdout == ""
