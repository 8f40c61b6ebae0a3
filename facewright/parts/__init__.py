"""Eyes, teeth, tongue and skeleton placed for a person, and the rig put together."""

from facewright.parts.assemble import AssemblyOptions, build_rig
from facewright.parts.fit import PartOptions, fit_parts, fit_skeleton
from facewright.parts.iris import PATTERNS, EyeLook
from facewright.parts.iris_scan import Iris, find_irises

__all__ = [
    "PATTERNS",
    "AssemblyOptions",
    "EyeLook",
    "Iris",
    "PartOptions",
    "build_rig",
    "find_irises",
    "fit_parts",
    "fit_skeleton",
]
