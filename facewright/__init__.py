"""Facewright: one neutral 3D scan of a head in, a face rig ready to animate out."""

__version__ = "0.1.0"
