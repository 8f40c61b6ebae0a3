"""A puppet's picture is that of a scene made anew in the pose."""

from dataclasses import replace

import numpy as np
import pytest

from facewright.evaluate.play import Player
from facewright.mesh.raster import Camera
from facewright.mesh.scene import Scene
from facewright.parts import build_rig
from facewright.write.close_ups import close_up_cameras
from facewright.write.puppet import Puppet, mouth_shades, picture, rig_drawables, shown_meshes

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


def test_teeth_between_funnelled_lips_have_less_light_than_in_a_smile(rig):
    """And least between shut ones, whose lining is dark as well; what a mouth does not show keeps all of it."""
    meshes, play = shown_meshes(rig, textured=False), Player(rig, full=True)
    at = [mesh.name for mesh in meshes].index("teeth_upper")
    front = meshes[at].vertices[:, 2] > meshes[at].vertices[:, 2].max() - 4.0
    poses = {}, {"mouthFunnel": 1.0}, {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0, "jawOpen": 0.3}
    shades = [mouth_shades(rig, play.meshes(meshes, pose)) for pose in poses]
    shut, funnel, smile = (np.median(shade[at][front]) for shade in shades)
    assert shut < funnel < 0.8 * smile
    inside = rig.regions["mouth_interior"]
    assert np.median(shades[0][0][inside]) < 0.2 and (shades[2][0][~inside] == 1.0).all()
    without = replace(rig, lines={})
    assert (mouth_shades(without, [mesh.vertices for mesh in meshes])[at] == 1.0).all()


def test_a_tongue_that_is_out_lies_in_the_light(rig):
    meshes, play = shown_meshes(rig, textured=False), Player(rig, full=True)
    at = [mesh.name for mesh in meshes].index("tongue")
    posed = play.meshes(meshes, {"tongueOut": 1.0, "jawOpen": 0.5})
    shade, depth = mouth_shades(rig, posed)[at], posed[at][:, 2].max() - posed[at][:, 2]
    assert shade[depth < 10.0].min() > 0.85 > 0.6 > shade[depth > 60.0].max()


def test_a_pose_leaves_no_trace(rig):
    puppet, camera = Puppet(rig), close_up_cameras(rig)[2]
    before = puppet.picture({}, camera)
    assert (puppet.picture(POSE, camera) != before).any()
    np.testing.assert_array_equal(puppet.picture({}, camera), before)
