"""Expressions and visemes blended as animation blends them."""

from __future__ import annotations

import numpy as np

# Shapes that no face makes together: the weaker is left out.
OPPOSED = (("eyeLookUp", "eyeLookDown"), ("eyeLookIn", "eyeLookOut"), ("eyeWide", "eyeBlink"), ("eyeWide", "eyeSquint"))
OPPOSED_MIDDLE = (("jawLeft", "jawRight"), ("mouthLeft", "mouthRight"))


def random_blends(expressions, visemes, count, seed):
    """count poses {shape: weight}: two expressions faded into each other, and a viseme that speaks at the same time.

    Both fade and the strengths of expression and viseme are even in 0..1; weights add up and end at 1.
    """
    rng = np.random.default_rng(seed)
    faces, words = list(expressions.values()), list(visemes.values())
    poses = []
    for _ in range(count):
        one, other = (faces[i] for i in rng.integers(len(faces), size=2))
        fade, strength, speech = rng.random(3)
        parts = ((one, strength * (1 - fade)), (other, strength * fade), (words[rng.integers(len(words))], speech))
        poses.append(possible(_sum(parts)))
    return poses


def possible(weights):
    """A pose that a face could make: of opposed shapes the stronger, mouthClose no more than jawOpen.

    mouthClose is made on top of jawOpen and is no pose without it; the tongue comes out between open teeth.
    """
    result = {name: min(weight, 1.0) for name, weight in weights.items() if weight > 0.0}
    pairs = [(a + side, b + side) for a, b in OPPOSED for side in ("Left", "Right")]
    for a, b in (*pairs, *OPPOSED_MIDDLE):
        if a in result and b in result:
            del result[a if result[a] < result[b] else b]
    for name, share in (("mouthClose", 1.0), ("tongueOut", 2.0)):
        if name in result:
            result[name] = min(result[name], share * result.get("jawOpen", 0.0))
    return result


def _sum(parts):
    total = {}
    for weights, strength in parts:
        for name, weight in weights.items():
            total[name] = total.get(name, 0.0) + strength * weight
    return total
