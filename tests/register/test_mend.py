"""What is wrong in a fitted skin is made good, and what is right stays as it is."""

import numpy as np
import pytest

from facewright.mesh.closest import Surface
from facewright.mesh.facing import folded_faces
from facewright.register.mend import without_folds


@pytest.fixture(scope="module")
def skin(hm08):
    """The template's own skin as a scan: vertices, faces and Surface."""
    stop, faces = hm08.skin.vertices[1], hm08.faces[hm08.skin.face_slice]
    vertices = hm08.vertices[:stop]
    return vertices, faces, Surface(vertices, faces)


def test_a_skin_without_folds_is_left_as_it_is(hm08, skin):
    vertices, faces, surface = skin
    assert without_folds(hm08, vertices, faces, surface) is vertices


def test_a_vertex_pushed_past_its_neighbours_comes_back(hm08, skin):
    vertices, faces, surface = skin
    cheek = vertices + [0.0, 0.0, 0.0]
    place = np.linalg.norm(vertices - hm08.landmarks.positions(hm08.vertices, hm08.faces)[0], axis=1).argmin()
    ring = np.unique(faces[(faces == place).any(axis=1)])
    ahead = ring[(vertices[ring] - vertices[place])[:, 0].argmax()]
    cheek[place] += 2.0 * (vertices[ahead] - vertices[place])
    asked = hm08.regions["face"][: len(vertices)][faces].all(axis=1)
    assert len(folded_faces(surface, cheek, faces, asked))
    mended = without_folds(hm08, cheek, faces, surface)
    assert not len(folded_faces(surface, mended, faces, asked))
    far = np.linalg.norm(vertices - vertices[place], axis=1) > 15.0
    assert np.array_equal(mended[far], cheek[far])
