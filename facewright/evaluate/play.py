"""A Rig played: its meshes under pose weights, as a right runtime shows them, or with the plain shapes alone."""

from __future__ import annotations

import numpy as np

from facewright.expand import expand_weights


def both_sides(weights, names):
    """Weights with every shape that has no name of its own played on both sides; None if one is missing in names."""
    found = {}
    for name, weight in weights.items():
        mine = [name] if name in names else [name + "Left", name + "Right"]
        if not set(mine) <= set(names):
            return None
        found |= dict.fromkeys(mine, weight)
    return found


class Player:
    """Poses of a Rig. full: with in-betweens and correctives; else as a player that knows one weight per shape.

    A rig that has halves in place of their sums is played through its halves either way.
    """

    def __init__(self, rig, full):
        self.rig, self.full = rig, full
        self._index = {name: i for i, name in enumerate(rig.target_names)}
        self._halves = {name: sides for name, sides in rig.halves.items() if name not in self._index}
        self.names = set(self._index) | set(self._halves)

    def targets(self, weights):
        """dict target -> weight that play a pose of shape weights."""
        tables = (self.rig.in_betweens, self.rig.correctives) if self.full else ({}, {})
        return expand_weights(weights, *tables, self._halves)

    def __call__(self, mesh, weights, at=slice(None)):
        """(n, 3) vertices of a mesh of the rig in a pose; only those of the slice or index at."""
        return self._moved(mesh, self.targets(weights), at)

    def meshes(self, meshes, weights):
        """The vertices of several meshes in a pose; of one that never moves its own."""
        targets = self.targets(weights)
        return [mesh.vertices if mesh.deltas is None else self._moved(mesh, targets) for mesh in meshes]

    def _moved(self, mesh, targets, at=slice(None)):
        result = np.array(mesh.vertices[at])
        if mesh.deltas is not None:
            for name, weight in targets.items():
                result += weight * mesh.deltas[self._index[name]][at]
        return result
