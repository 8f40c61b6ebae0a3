"""FaceZip: many expression textures as a few difference textures and small weight maps. Needs no rig."""

from facewright.compress.encode import FacezipOptions, facezip, facezip_maps
from facewright.compress.packed import Packed, example_weights, facezip_decode, naive_example

__all__ = ["FacezipOptions", "Packed", "example_weights", "facezip", "facezip_decode", "facezip_maps", "naive_example"]
