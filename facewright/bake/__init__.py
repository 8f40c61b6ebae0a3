"""Maps of a scan's looks in the layout of a fitted head."""

import sys

from facewright import StagePackage
from facewright.bake.maps import BakeOptions, bake, describe_maps

__all__ = ["BakeOptions", "bake", "describe_maps"]

sys.modules[__name__].__class__ = StagePackage  # facewright.bake(...) is facewright.bake.bake(...)
