"""Shapes of one head on another."""

from facewright.transfer.deformation import DeformationTransfer, deformation_transfer
from facewright.transfer.riders import ride_on_lids
from facewright.transfer.shapes import TransferOptions, transfer_shapes
from facewright.transfer.within import keep_within_amplitudes, keep_within_regions

__all__ = [
    "DeformationTransfer",
    "TransferOptions",
    "deformation_transfer",
    "keep_within_amplitudes",
    "keep_within_regions",
    "ride_on_lids",
    "transfer_shapes",
]
