"""What leads the corners of eyes: the ends of lids that the relief shows, unless a person says more."""

import numpy as np
import pytest
import scipy.sparse as sp

from facewright.data import Scan
from facewright.register.leading import leading_lines
from facewright.register.lids import FORWARD, Border
from facewright.register.model import ModelFit
from facewright.register.pairs import LIDS, Pairs

MOVED = np.array([1.5, 2.5, 0.0])


def corner_led_by(template, placed, ends):
    """Targets of all rows on the left upper lid's first vertex, its landmark and the lid's end being MOVED from it.

    The landmark is moved the other way.
    """
    line, skin = template.lines["lid_upper_left"], template.skin
    V = template.vertices
    first = np.array([line[0]])
    inner = np.linalg.norm(V[line[0]]) < np.linalg.norm(V[line[-1]])
    name = f"mp{LIDS['left'][0][0 if inner else -1]}"
    rows = sp.csr_matrix((np.ones(1), (np.zeros(1, int), first)), shape=(1, len(V)))
    pairs = Pairs((name,), V[first] - MOVED, rows, np.ones(1), V[first], np.array([placed]))
    middle = V[line[2:-2]]
    places = np.array([0, len(line) - 1])
    given = (places, V[line[places]] + MOVED) if ends else None
    border = Border(middle[np.argsort(middle[:, 0])], FORWARD, given)
    scan = Scan(vertices=V, faces=template.faces[skin.face_slice])
    model = ModelFit(V, V, np.zeros(0), np.zeros(0), np.eye(4), 0.0)
    closed = {"left": False, "right": False}
    leading, _ = leading_lines(scan, template, model, pairs, closed, {"left": (border, None)})
    found = []
    for function in leading:
        for led in function(V[: skin.vertices[1]]):
            at = led.matrix[:, line[0]].toarray().ravel() * (np.broadcast_to(led.weights, led.matrix.shape[:1]) > 0)
            found += list(led.targets[at > 0] - V[line[0]])
    return np.array(found)


def test_the_ends_of_a_lid_lead_its_corners_instead_of_landmarks(hm08):
    assert (corner_led_by(hm08, placed=False, ends=True) @ MOVED > 0).all()


@pytest.mark.parametrize(("placed", "ends"), [(True, True), (False, False), (True, False)])
def test_a_corner_that_a_person_placed_or_no_relief_shows_is_led_by_its_landmark(hm08, placed, ends):
    assert (corner_led_by(hm08, placed, ends) @ MOVED < 0).all()
