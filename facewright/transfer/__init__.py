"""Shapes of one head on another."""

from facewright.transfer.deformation import DeformationTransfer, deformation_transfer
from facewright.transfer.riders import ride_on_lids
from facewright.transfer.shapes import TransferOptions, transfer_shapes

__all__ = ["DeformationTransfer", "TransferOptions", "deformation_transfer", "ride_on_lids", "transfer_shapes"]
