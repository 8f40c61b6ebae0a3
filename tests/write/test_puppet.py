"""A puppet's picture is that of a scene made anew in the pose."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.evaluate.play import Player
from facewright.mesh.raster import Camera
from facewright.mesh.scene import Scene
from facewright.parts import build_rig
from facewright.write.close_ups import close_up_cameras
from facewright.write.puppet import Puppet, picture, rig_drawables

POSE = {"jawOpen": 0.8, "eyeLookInLeft": 1.0, "browInnerUp": 0.5}


@pytest.fixture(scope="module")
def rig(hm08, hm08_person):
    return build_rig(replace(hm08_person(0), vertices=hm08.vertices), hm08.deltas)


def test_what_is_left_out_changes_no_pixel(rig):
    puppet, play = Puppet(rig), Player(rig, full=True)
    posed = replace(rig, meshes=tuple(replace(mesh, vertices=play(mesh, POSE), deltas=None) for mesh in rig.meshes))
    anew = Scene(rig_drawables(posed, textured=False))
    side = Camera.looking_at((20.0, -40.0, 40.0), 60.0, 10.0, 40.0, (120, 160))
    for camera in (*close_up_cameras(rig), side):
        got, expected = puppet.picture(POSE, camera).astype(int), picture(anew, camera).astype(int)
        assert (np.abs(got - expected).max(axis=2) > 2).mean() < 1e-4


def test_a_pose_leaves_no_trace(rig):
    puppet, camera = Puppet(rig), close_up_cameras(rig)[2]
    before = puppet.picture({}, camera)
    assert (puppet.picture(POSE, camera) != before).any()
    np.testing.assert_array_equal(puppet.picture({}, camera), before)
