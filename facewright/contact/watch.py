"""Which of some points can have reached a surface since they were last asked, so that the rest need no asking."""

from __future__ import annotations

import numpy as np

from facewright.mesh.normals import lengths


class Watch:
    """Points of a pose, each with a clearance: how far it was from a surface that it had not passed.

    A point that has moved less against the surface than its clearance is still on the same side of it. What is known of
    one pose thus serves the next one, of the same shape or another.
    points (k, 3), surface (m, 3) mm, clearance (k,) mm; default: none, so that all must be asked
    """

    def __init__(self, points, surface, clearance=None):
        self._points, self._surface = points, surface
        self._clearance = np.zeros(len(points)) if clearance is None else clearance

    def at(self, points, surface):
        """The Watch for another pose, points (k, 3) and surface (m, 3), in which clearances are what is left of them.

        Surface and points moving together cost none.
        """
        shift = surface - self._surface
        common = shift.mean(axis=0)
        sway = lengths(shift - common).max(initial=0.0)
        return Watch(points, surface, self._clearance - lengths(points - self._points - common) - sway)

    def due(self):
        """(d,) indices of the points that must be asked, in order."""
        return np.flatnonzero(self._clearance <= 0.0)

    def clear(self):
        """(k,) bool: points that are known not to have passed the surface."""
        return self._clearance > 0.0

    def reach(self):
        """(k,) mm by which points that had no clearance may have got past the surface since they were asked."""
        return np.maximum(-self._clearance, 0.0)

    def answered(self, index, clearance):
        """The Watch after points of an index (d,) were found to have a clearance (d,) mm; less than 0: past it."""
        known = np.array(self._clearance)
        known[index] = clearance
        return Watch(self._points, self._surface, known)
