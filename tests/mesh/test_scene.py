import numpy as np

from facewright.mesh.raster import Camera
from facewright.mesh.render import BACKGROUND, LIGHTS, linear_to_srgb
from facewright.mesh.scene import Drawable, Scene

FACES = np.array([[0, 1, 2], [0, 2, 3]])
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
CAMERA = Camera.looking_at([0, 0, 0], half_height=10.0, size=(40, 40))
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def square(z=0.0, half=5.0, **looks):
    vertices = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return Drawable(vertices, FACES, **looks)


def test_unlit_color_and_background():
    image = Scene([square(color=RED)]).render(CAMERA, unlit=True)
    assert (image[20, 20] == (255, 0, 0)).all()
    np.testing.assert_allclose(image[2, 2], np.array(BACKGROUND) * 255, atol=1)


def test_the_nearer_mesh_hides_the_farther():
    image = Scene([square(0, color=RED), square(1, 2.0, color=BLUE)]).render(CAMERA, unlit=True)
    assert (image[20, 20] == (0, 0, 255)).all()
    assert (image[20, 12] == (255, 0, 0)).all()


def test_transparency_mixes_linear_light():
    image = Scene([square(0, color=RED), square(1, color=BLUE, opacity=0.25)]).render(CAMERA, unlit=True)
    expected = linear_to_srgb(np.array([0.75, 0, 0.25])) * 255
    np.testing.assert_allclose(image[20, 20], expected, atol=1)


def test_what_lies_just_behind_a_transparent_strip_is_seen_and_not_what_lies_behind_that():
    layers = [square(0, color=BLUE), square(1, color=RED), square(1.005, color=BLUE, opacity=0.25)]
    image = Scene(layers).render(CAMERA, unlit=True)
    np.testing.assert_allclose(image[20, 20], linear_to_srgb(np.array([0.75, 0, 0.25])) * 255, atol=1)


def test_a_strip_in_the_same_place_as_the_skin_hides_none_of_it():
    for shift in (0.0, 0.0005, -0.0005):
        layers = [square(0, color=BLUE), square(1, color=RED), square(1 + shift, color=RED, opacity=0.25)]
        image = Scene(layers).render(CAMERA, unlit=True)
        assert (image[12:28, 12:28] == (255, 0, 0)).all()


def test_shade_takes_light_and_gloss_alike():
    looks = {"color": RED, "roughness": 0.2}
    bright, dark = (Scene([square(**looks, shade=np.full(4, share))]).render(CAMERA)[20, 20] for share in (1.0, 0.0))
    assert (bright == Scene([square(**looks)]).render(CAMERA)[20, 20]).all()
    assert bright.max() > 100 and not dark.any()


def test_what_is_clear_shines_as_what_is_not_and_what_is_not_there_does_not():
    def bright(opacity, alpha):
        key = np.array(LIGHTS[0][:3]) / np.linalg.norm(LIGHTS[0][:3]) + [0, 0, 1]
        look = {"roughness": 0.2, "normals": np.tile(key / np.linalg.norm(key), (4, 1)), "opacity": opacity}
        strip = square(1, texture=np.full((2, 2, 4), (0, 0, 0, alpha), np.uint8), uv=UV, uv_faces=FACES, **look)
        return Scene([square(0, color=(0.0, 0.0, 0.0)), strip]).render(CAMERA)[20, 20].min()

    assert bright(0.05, 255) == bright(1.0, 255) > 200
    assert bright(0.05, 0) == 0


def test_texture_stands_upright_and_its_fourth_channel_is_opacity():
    texture = np.zeros((2, 2, 4), np.uint8)
    texture[0, 0] = (255, 0, 0, 255)  # top left: v near 1
    texture[1, 1] = (0, 255, 0, 0)  # bottom right, transparent
    image = Scene([square(texture=np.kron(texture, np.ones((8, 8, 1), np.uint8)), uv=UV, uv_faces=FACES)])
    image = image.render(CAMERA, unlit=True)
    assert (image[13, 13] == (255, 0, 0)).all()
    np.testing.assert_allclose(image[27, 27], np.array(BACKGROUND) * 255, atol=1)


def test_a_fine_texture_is_averaged_from_afar():
    checks = np.indices((64, 64)).sum(axis=0) % 2 * 255
    texture = np.repeat(checks[..., None], 3, axis=2).astype(np.uint8)
    image = Scene([square(texture=texture, uv=UV, uv_faces=FACES)]).render(
        Camera.looking_at([0, 0, 0], half_height=20.0, size=(32, 32)), unlit=True
    )
    assert 120 < image[16, 16, 0] < 136


def test_outlines_are_smooth_and_flat_normal_maps_change_nothing():
    turned = Drawable(square().vertices @ _turn(0.3).T, FACES, color=RED)
    image = Scene([turned]).render(CAMERA, unlit=True)[..., 0]
    background = round(BACKGROUND[0] * 255)
    assert len(np.unique(image)) >= 4, "edge pixels between the two tones"
    assert {background, 255} <= set(np.unique(image).tolist())

    flat = np.full((4, 4, 3), (128, 128, 255), np.uint8)
    plain = Scene([square(color=RED)]).render(CAMERA)
    mapped = Scene([square(color=RED, normal_map=flat, uv=UV, uv_faces=FACES)]).render(CAMERA)
    np.testing.assert_array_equal(plain, mapped)


def test_a_normal_map_turns_towards_its_own_up():
    tilted = np.full((4, 4, 3), (128, 218, 218), np.uint8)  # 45 degrees towards +v
    camera_below = Camera.looking_at([0, 0, 0], pitch_deg=0.0, half_height=10.0, size=(40, 40))
    lit = Scene([square(color=(0.5, 0.5, 0.5), normal_map=tilted, uv=UV, uv_faces=FACES)]).render(camera_below)
    upside_down = Scene([square(color=(0.5, 0.5, 0.5), normal_map=tilted, uv=1 - UV, uv_faces=FACES)])
    assert lit[20, 20, 0] > upside_down.render(camera_below)[20, 20, 0] + 10, "the key light comes from above"


def _turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
