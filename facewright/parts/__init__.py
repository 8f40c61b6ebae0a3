"""Eyes, teeth, tongue and skeleton placed for a person, and the rig put together."""

from facewright.parts.assemble import AssemblyOptions, build_rig
from facewright.parts.fit import PartOptions, fit_parts, fit_skeleton

__all__ = ["AssemblyOptions", "PartOptions", "build_rig", "fit_parts", "fit_skeleton"]
