"""The shapes of one head with what their paths and pairs need: in-betweens and correctives."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from facewright.conventions import in_between_name, mirrored_name
from facewright.expand import expand_weights

_EVEN_MM = 1e-6


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

    def evened(self, mirror):
        """Targets in which each is the mirror image of its twin on the other side; mirror (n,) as in Template."""

        def even(name):
            own, twin = self.delta(name), self.delta(_twin(name, self))
            return 0.5 * (own + twin[mirror] * [-1.0, 1.0, 1.0])

        deltas = np.array([even(name) for name in self.names])
        return replace(self, deltas=deltas, extras={name: even(name) for name in self.extras})

    def motion(self, weights):
        """(n, 3) displacement under dict shape -> weight, as a player with in-betweens and correctives shows it."""
        played = expand_weights(weights, self.in_betweens, self.correctives)
        return sum((weight * self.delta(name) for name, weight in played.items()), np.zeros(self.deltas.shape[1:]))


def _twin(target, targets):
    """The target that does on the other side what this one does; itself where there is none."""
    twins = {name: mirrored_name(name) for name in targets.names}
    for name, steps in targets.in_betweens.items():
        twins |= {step: in_between_name(mirrored_name(name), weight) for weight, step in steps.items()}
    for name, drivers in targets.correctives.items():
        mirrored = {mirrored_name(driver) for driver in drivers}
        twins[name] = next((other for other, own in targets.correctives.items() if set(own) == mirrored), name)
    twin = twins.get(target, target)
    return twin if twin in targets.names or twin in targets.extras else target


def is_even(face):
    """Whether a head's skin is its own mirror image: then what rests on its middle line has no nearer side."""
    skin = face.template.skin.vertex_slice
    mirrored = face.vertices[face.template.mirror[skin]] * [-1.0, 1.0, 1.0]
    return bool(np.abs(mirrored - face.vertices[skin]).max() < _EVEN_MM)
