"""Shapes of one head on another."""

from facewright.transfer.deformation import DeformationTransfer, deformation_transfer
from facewright.transfer.shapes import TransferOptions, transfer_shapes

__all__ = ["DeformationTransfer", "TransferOptions", "deformation_transfer", "transfer_shapes"]
