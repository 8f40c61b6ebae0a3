"""Which of some points can have reached a surface since they were last asked, so that the rest need no asking."""

from __future__ import annotations

import numpy as np


class Watch:
    """Points of a pose, each with a clearance: how far it was from a surface that it had not passed.

    A point that has moved less against the surface than its clearance is still on the same side of it. What is known of
    one pose thus serves the next one, of the same shape or another.
    points (k, 3), surface (m, 3) mm; at first no point has any clearance
    """

    def __init__(self, points, surface):
        self._points, self._surface = points, surface
        self._clearance = np.zeros(len(points))

    def due(self, points, surface):
        """(d,) indices of the points (k, 3) that must be asked about a surface (m, 3), in order."""
        return np.flatnonzero(self._left(points, surface) <= 0.0)

    def seen(self, points, surface, index, clearance):
        """The Watch for the next pose, after points of an index (d,) were found to have a clearance (d,) mm."""
        later = Watch(points, surface)
        later._clearance = self._left(points, surface)
        later._clearance[index] = clearance
        return later

    def _left(self, points, surface):
        """(k,) clearance that is left; surface and points moving together cost none."""
        shift = surface - self._surface
        common = shift.mean(axis=0)
        sway = np.linalg.norm(shift - common, axis=1).max(initial=0.0)
        return self._clearance - np.linalg.norm(points - self._points - common, axis=1) - sway
