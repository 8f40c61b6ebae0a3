"""Expressions and visemes blended as animation blends them."""

from __future__ import annotations

from itertools import combinations

import numpy as np

# Shapes that no face makes together: the weaker is left out.
OPPOSED = (("eyeLookUp", "eyeLookDown"), ("eyeLookIn", "eyeLookOut"), ("eyeWide", "eyeBlink"), ("eyeWide", "eyeSquint"))
OPPOSED_MIDDLE = (("jawLeft", "jawRight"), ("mouthLeft", "mouthRight"))
# Powers of the root of x^4 = x + 1, less than 1: points by these steps fill a cube evenly (Roberts 2018).
_EVEN_STEPS = 0.8191725134, 0.6710436067, 0.5497004779


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
        poses.append(_blend(one, other, fade, strength, words[rng.integers(len(words))], speech))
    return poses


def all_blends(expressions, visemes):
    """Poses {shape: weight} of every two expressions faded into each other, each with the next viseme.

    Fade and strengths go through 0..1 by steps that fill it evenly, strengths more often through the upper half.
    """
    words, poses = list(visemes.values()), []
    for one, other in combinations(expressions.values(), 2):
        fade, strength, speech = (len(poses) * step % 1.0 for step in _EVEN_STEPS)
        poses.append(_blend(one, other, fade, strength**0.5, words[len(poses) % len(words)], speech**0.5))
    return poses


def _blend(one, other, fade, strength, word, speech):
    return possible(_sum(((one, strength * (1 - fade)), (other, strength * fade), (word, speech))))


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
