"""Scans from files: the only place that knows other formats, frames and units than ours."""

from facewright.read.scan import read_scan

__all__ = ["read_scan"]
