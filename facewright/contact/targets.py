"""The shapes of one head with what their paths and pairs need: in-betweens and correctives."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from facewright.expand import expand_weights


@dataclass(frozen=True)
class Targets:
    """names (s,) and deltas (s, n, 3) mm of the shapes; extras name -> (n, 3): in-betweens "name@0.5" and correctives
    "a+b"; in_betweens and correctives as in data.Rig."""

    names: tuple[str, ...]
    deltas: np.ndarray
    extras: dict[str, np.ndarray] = field(default_factory=dict)
    in_betweens: dict[str, dict[float, str]] = field(default_factory=dict)
    correctives: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def delta(self, name):
        """(n, 3) of one target."""
        return self.extras[name] if name in self.extras else self.deltas[self.names.index(name)]

    def motion(self, weights):
        """(n, 3) displacement under dict shape -> weight, as a player with in-betweens and correctives shows it."""
        played = expand_weights(weights, self.in_betweens, self.correctives)
        return sum((weight * self.delta(name) for name, weight in played.items()), np.zeros(self.deltas.shape[1:]))
