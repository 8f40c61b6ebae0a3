"""The lining of lids kept behind their skin where cheek and lid press it to the ball.

Squint, raised cheek, sneer and a look down bring the same skin to the same place, and a player adds them. One by one
they stay off the ball, together they took the crease under the lid 2 mm into it, and the lining of the lid out through
the skin. Correctives would help those who play them; so each of these shapes goes around the ball as it must with the
others (eyes.EyeShapes), and what lies behind the skin gives way.
"""

from __future__ import annotations

import numpy as np

from facewright.mesh.raster import RayScene

BEHIND_MM, FROM_MM, FREE_MM = 0.25, 4.0, 2.0
"""How far behind the skin, from which distance off the margins on, and from where on lining gives way as it must:
at the margins it and the skin are one."""
_ROUNDS = 3
_DONE_MM = 1e-3


class LidLining:
    """The lining behind the lids of one eye.

    rest (n, 3) mm: the skin at rest, of which no more is asked than it has; skin_faces, lining_faces (m, 3), (l, 3)
    distance (n,) mm from the margins; center (3,) of the ball
    gives (n,) bool: lining that may give way, into the ball if need be
    """

    def __init__(self, rest, skin_faces, lining_faces, distance, gives, center):
        self._skin_faces, self._lining_faces, self._center = skin_faces, lining_faces, center
        self._skin, self._gives = np.unique(skin_faces), np.flatnonzero(gives)
        behind = BEHIND_MM * np.minimum(distance / FROM_MM, 1.0)
        self._under_skin = np.clip(-self._above(rest, lining_faces, self._skin)[1], 0.0, behind[self._skin])
        self._room = np.clip(self._above(rest, skin_faces, self._gives)[1], 0.0, behind[self._gives])
        self._gives_by = np.minimum(distance[self._gives] / FREE_MM, 1.0)

    def kept_behind(self, pose):
        """The pose (n, 3) with its lining behind its skin, as seen from the centre of the ball."""
        pose = pose.copy()
        for _ in range(_ROUNDS):
            need = np.zeros(len(pose))
            # Skin may dip in between the lining's vertices, which are few.
            hit, above = self._above(pose, self._lining_faces, self._skin)
            met = hit >= 0
            short = np.maximum(above[met] + self._under_skin[met], 0.0)
            np.maximum.at(need, self._lining_faces[hit[met]], short[:, None])
            hit, above = self._above(pose, self._skin_faces, self._gives)
            short = np.where(hit >= 0, self._room - above, 0.0)
            need = self._gives_by * np.maximum(need[self._gives], short)
            if need.max(initial=0.0) < _DONE_MM:
                break
            offset = pose[self._gives] - self._center
            pose[self._gives] -= offset * (need / np.linalg.norm(offset, axis=1))[:, None]
        return pose

    def _above(self, pose, faces, vertices):
        """(k,) which of faces lies above vertices (k,) as seen from the centre (-1: none), and how far."""
        offset = pose[vertices] - self._center
        length = np.linalg.norm(offset, axis=1)
        hits = RayScene(pose, faces).cast(np.broadcast_to(self._center, offset.shape), offset / length[:, None])
        return hits.face, hits.distance - length
