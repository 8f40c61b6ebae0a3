"""Contact between the moving pieces of a head, solved per head after transfer."""

from facewright.contact.eyes import EyeShapeOptions, EyeShapes, solve_eyes

__all__ = ["EyeShapeOptions", "EyeShapes", "solve_eyes"]
