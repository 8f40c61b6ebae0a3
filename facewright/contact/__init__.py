"""Contact between the moving pieces of a head, solved per head after transfer."""

from facewright.contact.blended import lay_blends_flat
from facewright.contact.crossings import part_crossings
from facewright.contact.eyes import EyeShapeOptions, EyeShapes, solve_eyes
from facewright.contact.folds import lay_flat
from facewright.contact.jaw import find_jaw, keep_jaw_within
from facewright.contact.lining import clear_lids, clear_lips, even_lining
from facewright.contact.mouth import MouthOptions, part_lips, solve_mouth
from facewright.contact.neck import hold_neck
from facewright.contact.targets import Targets
from facewright.contact.tongue import TongueOptions, lay_tongue

__all__ = [
    "EyeShapeOptions",
    "EyeShapes",
    "MouthOptions",
    "Targets",
    "TongueOptions",
    "clear_lids",
    "clear_lips",
    "even_lining",
    "find_jaw",
    "hold_neck",
    "keep_jaw_within",
    "lay_blends_flat",
    "lay_flat",
    "lay_tongue",
    "part_crossings",
    "part_lips",
    "solve_eyes",
    "solve_mouth",
]
