"""Maps of a scan's looks in the layout of a fitted head."""

from facewright.bake.maps import BakeOptions, bake, describe_maps

__all__ = ["BakeOptions", "bake", "describe_maps"]
