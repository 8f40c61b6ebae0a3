"""The embedded sample: a head that the project made itself, with the faults of a real scan and its truth beside it."""

from pathlib import Path

FOLDER = Path(__file__).parent


def sample_path():
    """The sample's scan, an OBJ file with its MTL and albedo beside it."""
    return FOLDER / "head.obj"


def truth_path():
    """An npz: vertices (n, 3) where every vertex of hm08 truly is, in the scan file's units; topology_id, seed."""
    return FOLDER / "truth.npz"
