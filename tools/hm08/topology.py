"""Loops and rings of a quad mesh (Q (m, 4)): how the mouth, the eyes, the nostrils and the neck are found."""

from __future__ import annotations

from collections import defaultdict

import numpy as np


class QuadTopology:
    """Who is next to whom in a quad mesh."""

    def __init__(self, Q):
        self.Q = np.asarray(Q)
        self.faces_of_edge = defaultdict(list)
        self.neighbours = defaultdict(list)
        self.faces_of_vertex = defaultdict(list)
        for face, quad in enumerate(self.Q.tolist()):
            for i in range(4):
                a, b = quad[i], quad[(i + 1) % 4]
                self.faces_of_edge[frozenset((a, b))].append(face)
                self.faces_of_vertex[a].append(face)
                for v, w in ((a, b), (b, a)):
                    if w not in self.neighbours[v]:
                        self.neighbours[v].append(w)

    def edge_loop(self, a, b):
        """Vertices of the loop that starts with the edge (a, b) and goes straight on at every regular vertex."""
        loop, previous, vertex = [a], a, b
        while vertex != a:
            loop.append(vertex)
            near = {w for face in self.faces_of_edge[frozenset((previous, vertex))] for w in self.Q[face].tolist()}
            onward = [w for w in self.neighbours[vertex] if w not in near]
            if len(onward) != 1:
                raise ValueError(f"edge loop from ({a}, {b}) stops at vertex {vertex}: it has no straight edge")
            previous, vertex = vertex, onward[0]
        return loop

    def side_of_loop(self, loop, seed):
        """(m,) bool: faces reached from a face at vertex seed without crossing the closed loop."""
        wall = {frozenset(edge) for edge in zip(loop, loop[1:] + loop[:1])}
        inside = np.zeros(len(self.Q), bool)
        stack = [self.faces_of_vertex[seed][0]]
        inside[stack] = True
        while stack:
            quad = self.Q[stack.pop()].tolist()
            for i in range(4):
                edge = frozenset((quad[i], quad[(i + 1) % 4]))
                if edge in wall:
                    continue
                for face in self.faces_of_edge[edge]:
                    if not inside[face]:
                        inside[face] = True
                        stack.append(face)
        return inside

    def next_ring(self, loop, done):
        """The ring parallel to a loop, one quad on, index by index, and its faces; None where the grid ends.

        done (m,) bool: faces on the side that the step must not take
        """
        onward, strip = {}, []
        for a, b in zip(loop, loop[1:] + loop[:1]):
            faces = [face for face in self.faces_of_edge[frozenset((a, b))] if not done[face]]
            if len(faces) != 1:
                return None
            quad = self.Q[faces[0]].tolist()
            strip.append(faces[0])
            for v, other in ((a, b), (b, a)):
                i = quad.index(v)
                beyond = quad[(i + 1) % 4] if quad[(i + 1) % 4] != other else quad[i - 1]
                if onward.setdefault(v, beyond) != beyond:
                    return None
        ring = [onward[v] for v in loop]
        return (ring, strip) if len(set(ring)) == len(ring) else None

    def rings(self, loop, inner, n_in, n_out):
        """dict k -> ring, k = 0 the loop, negative on the inner side; and dict k -> strip between ring k and k + 1."""
        rings, strips = {0: list(loop)}, {}
        for sign, count, done in ((1, n_out, inner.copy()), (-1, n_in, ~inner)):
            for k in range(1, count + 1):
                step = self.next_ring(rings[sign * (k - 1)], done)
                if step is None:
                    break
                rings[sign * k], strip = step
                strips[k - 1 if sign > 0 else -k] = strip
                done[strip] = True
        return rings, strips
