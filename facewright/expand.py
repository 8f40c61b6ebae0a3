"""The one rule for in-betweens and correctives: pose weights to the weights of all targets.

web/expand.mjs says the same in JavaScript; a test keeps the two equal.
"""

from __future__ import annotations

from itertools import pairwise


def expand_weights(pose_weights, in_betweens, correctives, halves=None, names=None):
    """dict target -> weight of every target that plays a part, from dict shape -> weight.

    in_betweens  shape -> {weight: target}: targets the shape passes on its way to 1; each acts by a hat function that
                 is 1 at its own weight and 0 at its neighbours'. Outside 0..1 the nearest piece goes on: weights are
                 not clipped, as players of glTF do not.
    correctives  target -> drivers: acts with the product of the drivers' weights, each clipped to 0..1
    halves       sum -> (left, right), for a rig that has these in its place: a weight of the sum is given to both, and
                 as a driver it weighs as much as its halves on average
    names        all targets of the rig: a pose that names a shape beyond these and halves is a ValueError. Without
                 them no name is checked, and one that is in no table is its own target.
    """
    for name in pose_weights if names is not None else ():
        if name not in names and name not in (halves or {}):
            raise ValueError(f"the rig has no shape {name!r}")
    result = {}
    pose, drive = _halved(pose_weights, halves or {})
    for name, weight in pose.items():
        steps = {float(w): target for w, target in in_betweens.get(name, {}).items()}
        stops = [0.0, *sorted(steps), 1.0]
        targets = {**steps, 1.0: name}
        piece = next((pair for pair in pairwise(stops) if weight <= pair[1]), (stops[-2], 1.0))
        share = (weight - piece[0]) / (piece[1] - piece[0])
        for stop, part in zip(piece, (1.0 - share, share)):
            if stop > 0.0 and part != 0.0:
                result[targets[stop]] = result.get(targets[stop], 0.0) + part
    for target, drivers in correctives.items():
        product = 1.0
        for driver in drivers:
            weight = drive.get(driver, 0.0)
            if weight <= 0.0:
                product = 0.0
                break
            product *= min(weight, 1.0)
        if product != 0.0:
            result[target] = result.get(target, 0.0) + product
    return result


def _halved(pose_weights, halves):
    """The weights with sums given to their halves, and the weights that drive correctives."""
    pose = dict(pose_weights)
    for name, parts in halves.items():
        weight = pose.pop(name, 0.0)
        for part in parts if weight else ():
            pose[part] = pose.get(part, 0.0) + weight
    sums = {name: sum(pose.get(part, 0.0) for part in parts) / len(parts) for name, parts in halves.items()}
    return pose, pose | sums
