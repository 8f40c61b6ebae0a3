"""From a scan as it was read to a scan that stands in our frame with landmarks on it."""

from facewright.scan.clean import clean_scan
from facewright.scan.landmark_files import read_landmarks, write_landmarks
from facewright.scan.landmarks import lift_landmarks
from facewright.scan.pose import FoundFace, LandmarkOptions, find_landmarks

__all__ = [
    "FoundFace",
    "LandmarkOptions",
    "clean_scan",
    "find_landmarks",
    "lift_landmarks",
    "read_landmarks",
    "write_landmarks",
]
