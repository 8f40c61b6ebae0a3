"""The shipped template: what its asset promises, measured."""

import numpy as np
import pytest

from facewright.contact.teeth import rows_of_teeth
from facewright.conventions import ARKIT_SHAPES, mirrored_name
from facewright.evaluate.quality import lip_gaps_mm, self_intersections, torn_edges, visible_interior_mm2
from facewright.evaluate.uv import measure_uv
from facewright.mesh.adjacency import border_loops, half_edges, unique_edges, vertex_components
from facewright.mesh.folds import folded_by_shape
from facewright.mesh.raster import RayScene
from facewright.template.store import SHIPPED

FLIP = np.array([-1.0, 1.0, 1.0])
FOLDER = SHIPPED / "hm08"


@pytest.fixture(scope="module")
def skin_faces(hm08):
    return hm08.faces[hm08.skin.face_slice]


def test_it_is_small_and_says_where_it_comes_from():
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) <= 10e6
    notice = (FOLDER / "LICENSE.txt").read_text()
    assert "CC0 1.0" in notice and "Face Units asset pack by Mika Suominen" in notice and "Data Collection AB" in notice


def test_counts_and_edge_lengths(hm08, skin_faces):
    assert 15_000 <= hm08.skin.vertices[1] <= 25_000 and len(hm08.vertices) <= 31_000
    edges = unique_edges(skin_faces)
    length = np.linalg.norm(np.subtract(*hm08.vertices[edges.T]), axis=1)
    for region, most in (("lips", 1.7), ("eyes", 1.7), ("face", 2.6)):
        assert length[hm08.regions[region][edges].all(axis=1)].mean() < most


def test_skin_is_one_shell_with_one_border(hm08, skin_faces):
    edges = half_edges(skin_faces)
    assert len(np.unique(edges, axis=0)) == len(edges)
    (ring,) = border_loops(skin_faces)
    assert set(ring.tolist()) == set(hm08.lines["neck_ring"].tolist())


def test_mirror_is_exact(hm08):
    mirror = hm08.mirror
    assert (mirror[mirror] == np.arange(len(mirror))).all()
    np.testing.assert_array_equal(hm08.vertices[mirror], hm08.vertices * FLIP)
    faces = {tuple(sorted(face)) for face in hm08.faces.tolist()}
    assert faces == {tuple(sorted(face)) for face in mirror[hm08.faces].tolist()}
    for name, mask in hm08.regions.items():
        twin = {"left": "right", "right": "left"}.get(name.rsplit("_", 1)[-1])
        other = name.rsplit("_", 1)[0] + "_" + twin if twin else name
        np.testing.assert_array_equal(mask[mirror], hm08.regions[other])


def test_frame_and_eyes(hm08):
    centers = hm08.skeleton.positions[3:]
    np.testing.assert_allclose(centers.mean(axis=0)[:2], 0.0, atol=1e-9)
    assert 62.0 <= centers[0, 0] - centers[1, 0] <= 63.0
    eye = hm08.vertices[hm08.part("eye_left").vertex_slice] - centers[0]
    radius = np.linalg.norm(eye, axis=1)
    assert np.isclose(np.median(radius), 12.0, atol=0.01)
    cornea = hm08.vertices[hm08.part("cornea_left").vertex_slice] - centers[0]
    front = cornea[:, 2].argmax()
    assert 12.9 < cornea[front, 2] < 13.3
    np.testing.assert_allclose(cornea[front, :2], 0.0, atol=1e-9)


def test_the_iris_lies_behind_a_cornea_that_leaves_no_gap(hm08):
    """Nearly flat, 2.5 to 3.3 mm behind the apex; all around, the cornea's edge dips a little into the white."""
    center = hm08.skeleton.positions[3]
    eye, cornea = (hm08.part(f"{name}_left") for name in ("eye", "cornea"))
    points = hm08.vertices[eye.vertex_slice] - center
    iris = np.hypot(points[:, 0], points[:, 1]) < 5.2
    iris &= points[:, 2] > 0
    behind = hm08.vertices[cornea.vertex_slice, 2].max() - center[2] - points[iris, 2]
    assert iris.sum() > 100 and behind.min() > 2.5 and behind.max() < 3.3
    balls = [RayScene(hm08.vertices - center, hm08.faces[part.face_slice]) for part in (eye, cornea)]
    turn = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    for degrees, before in ((1, True), (15, True), (29, True), (33.5, False)):
        across = np.sin(np.radians(degrees))
        out = np.stack([across * np.cos(turn), across * np.sin(turn), np.full(90, np.cos(np.radians(degrees)))], axis=1)
        white, clear = (13.5 - ball.cast(13.5 * out, -out).distance for ball in balls)
        assert ((clear > white) == before).all() and (before or (white - clear).max() < 0.15)


def test_lids_lie_on_the_ball_and_nothing_enters_it(hm08, skin_faces):
    center = hm08.skeleton.positions[3]
    margin = np.unique(np.concatenate([hm08.lines["lid_upper_left"], hm08.lines["lid_lower_left"]]))
    gap = np.linalg.norm(hm08.vertices[margin] - center, axis=1) - 12.0
    assert 0.1 < np.quantile(gap, 0.25) < 0.2 and gap.max() < 2.0
    for name in ("eye_left", "cornea_left"):
        eye = hm08.faces[hm08.part(name).face_slice]
        assert len(self_intersections(hm08.vertices, np.concatenate([skin_faces, eye]))) == 0


def test_eyes_end_in_a_point(hm08):
    upper, lower = (hm08.vertices[hm08.lines[f"lid_{lid}_left"]] for lid in ("upper", "lower"))
    for off, most in ((1.0, 2.6), (2.0, 4.4), (3.0, 5.8)):
        above, below = (np.interp(upper[-1, 0] - off, *line[np.argsort(line[:, 0]), :2].T) for line in (upper, lower))
        assert 0.5 * off < above - below < most
    for line in (upper, lower):  # and no vertex is crowded out
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        assert steps.min() > 0.1


def test_lips_are_closed(hm08, skin_faces):
    upper, lower = hm08.lines["lip_seam_upper"], hm08.lines["lip_seam_lower"]
    assert upper[0] == lower[0] and upper[-1] == lower[-1] and len(upper) == len(lower)
    assert hm08.vertices[upper[0], 0] < 0 < hm08.vertices[upper[-1], 0]
    gaps = lip_gaps_mm(hm08.vertices, hm08.lines)[1:-1]
    assert gaps.min() >= 0.05 and gaps.max() <= 0.2
    assert len(self_intersections(hm08.vertices[: hm08.skin.vertices[1]], skin_faces)) == 0
    teeth_and_tongue = np.zeros(len(hm08.faces), bool)
    for name in ("teeth_upper", "teeth_lower", "tongue"):
        teeth_and_tongue[hm08.part(name).face_slice] = True
    mouth = hm08.vertices[upper].mean(axis=0)
    assert visible_interior_mm2(hm08.vertices, hm08.faces, teeth_and_tongue, mouth) < 0.1


def test_lines_run_the_way_they_should(hm08):
    V, lines = hm08.vertices, hm08.lines
    for side, sign in (("left", 1), ("right", -1)):
        upper, lower = lines[f"lid_upper_{side}"], lines[f"lid_lower_{side}"]
        assert upper[0] == lower[0] and upper[-1] == lower[-1]
        assert sign * V[upper[0], 0] < sign * V[upper[-1], 0]  # inner corner first
        assert V[upper, 1].mean() > V[lower, 1].mean()
    edges = {tuple(edge) for edge in unique_edges(hm08.faces).tolist()}
    for name, line in lines.items():
        pairs = np.sort(np.stack([line[:-1], line[1:]], axis=1), axis=1)
        assert all(tuple(pair) in edges for pair in pairs.tolist()), name


def test_nostrils_have_depth(hm08):
    inside = hm08.regions["nostrils"] & (hm08.vertices[:, 0] > 0)
    rim = hm08.vertices[hm08.lines["nostril_left"]]
    assert (hm08.vertices[inside, 1] - rim[:, 1].max()).max() > 6.0
    assert hm08.openness[inside].mean() < 0.2 < hm08.openness[hm08.regions["face"]].mean()


def test_regions_fit_together(hm08):
    regions = hm08.regions
    inner = ["mouth_interior", "socket_left", "socket_right", "nostrils"]
    for name in inner:
        assert not (regions[name] & regions["outer"]).any()
    n_skin = hm08.skin.vertices[1]
    assert (np.sum([regions[name] for name in (*inner, "outer")], axis=0)[:n_skin] == 1).all()
    for name in ("face", "lips", "eyes", "neck", "scalp", "ear_left", "lip_upper", "lip_lower", "skull"):
        assert regions[name].any() and not (regions[name] & ~regions["outer"]).any()
    large = ("face", "neck", "scalp", "ear_left", "ear_right")
    assert (np.sum([regions[name] for name in large], axis=0)[regions["outer"]] == 1).all()


def test_atlas_meets_its_bars(hm08):
    figures = measure_uv(hm08)
    assert figures["front_share"] >= 0.20
    assert figures["front_px_per_mm_median"] >= 12.0 and figures["front_px_per_mm_p5"] >= 12.0
    assert figures["front_anisotropy_p95"] <= 1.5
    assert figures["front_scale_min"] >= 0.5 and figures["front_scale_max"] <= 2.0
    assert figures["flipped"] == 0 and figures["overlap_texels"] == 0
    assert figures["front_pieces"] == 1 and figures["front_seam_edges"] == 0
    assert hm08.uv.min() >= 0.0 and hm08.uv.max() <= 1.0


def test_shapes_are_symmetric_and_leave_the_skull_alone(hm08):
    assert hm08.shape_names == ARKIT_SHAPES
    for name in ARKIT_SHAPES:
        delta = hm08.shape(name)
        np.testing.assert_array_equal(delta[hm08.mirror] * FLIP, hm08.shape(mirrored_name(name)))
        assert 1.0 < np.linalg.norm(delta, axis=1).max() < 45.0
        assert not delta[hm08.regions["skull"]].any()
    blink = hm08.shape("eyeBlinkLeft")
    assert not blink[hm08.regions["socket_right"] | hm08.regions["mouth_interior"]].any()


def test_no_shape_folds_or_tears(hm08, skin_faces):
    n = hm08.skin.vertices[1]
    neutral, inside = hm08.vertices[:n], hm08.regions["mouth_interior"][:n]
    for name in ARKIT_SHAPES:
        pose = hm08.shape(name)[:n] + (hm08.shape("jawOpen")[:n] if name == "mouthClose" else 0.0)
        if not name.startswith("eye"):  # lids are made anew on each head
            assert not len(folded_by_shape(neutral, neutral + pose, skin_faces, ~inside[skin_faces].any(axis=1))), name
        assert not len(torn_edges(neutral, neutral + pose, skin_faces, ~inside)), name


def test_sizes_of_shapes(hm08):
    corner = hm08.lines["lip_seam_upper"][-1]
    assert 13.0 < np.linalg.norm(hm08.shape("mouthSmileLeft")[corner]) < 18.0
    chin = hm08.regions["face"] & (hm08.mirror == np.arange(len(hm08.mirror)))
    assert 35.0 < np.linalg.norm(hm08.shape("jawOpen")[chin], axis=1).max() < 42.0
    assert hm08.shape("mouthPucker")[hm08.lines["lip_seam_upper"], 2].min() > 7.0
    assert hm08.shape("noseSneerLeft")[hm08.lines["nostril_left"], 1].mean() > 4.0


def test_shapes_stay_where_they_belong(hm08):
    above = hm08.vertices[:, 1] > hm08.vertices[hm08.lines["lid_upper_left"], 1].max()
    right = hm08.vertices[:, 0] < hm08.vertices[hm08.lines["lip_seam_upper"], 0].min()
    for name in ARKIT_SHAPES:
        delta = np.linalg.norm(hm08.shape(name), axis=1)
        assert delta[hm08.lines["neck_ring"]].max() == 0.0
        if name.startswith(("mouth", "jaw", "cheekPuff")):
            assert delta[above].max() < 0.1, name
        if name.endswith("Left") and name not in ("mouthLeft", "jawLeft"):
            assert delta[right].max() < 0.1, name


def test_closed_lips_stay_closed(hm08):
    for name in ("mouthSmile", "mouthFrown", "mouthDimple", "mouthStretch", "mouthPress"):
        pose = hm08.vertices + hm08.shape(f"{name}Left") + hm08.shape(f"{name}Right")
        assert lip_gaps_mm(pose, hm08.lines).max() < 0.5, name
    pose = hm08.vertices + hm08.shape("jawOpen") + hm08.shape("mouthClose")
    assert lip_gaps_mm(pose, hm08.lines).max() < 0.3


@pytest.mark.parametrize(
    ("name", "axis", "sign", "degrees"), [("Up", 1, 1, 25), ("Down", 1, -1, 30), ("Out", 0, 1, 30)]
)
@pytest.mark.parametrize("part", ["eye_left", "cornea_left"])
def test_eyes_turn_about_their_centres(hm08, part, name, axis, sign, degrees):
    part = hm08.part(part).vertex_slice
    center = hm08.skeleton.positions[3]
    before = hm08.vertices[part] - center
    np.testing.assert_allclose(before[0, :2], 0.0, atol=1e-9)
    after = before + hm08.shape(f"eyeLook{name}Left")[part]
    np.testing.assert_allclose(np.linalg.norm(after, axis=1), np.linalg.norm(before, axis=1), atol=0.005)
    gaze = after[0]  # on the axis
    assert np.isclose(np.degrees(np.arcsin(gaze[axis] / np.linalg.norm(gaze))) * sign, degrees, atol=0.1)


def test_the_lower_lip_of_an_open_jaw_hangs_in_an_arc(hm08):
    line = hm08.lines["lip_seam_lower"]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(hm08.vertices[line], axis=0), axis=1))])
    q = 1.0 - np.abs(2.0 * way / way[-1] - 1.0)  # 0 at the corners, 1 in the middle
    drop = hm08.deltas[hm08.shape_names.index("jawOpen")][line, 1]
    share = (drop - drop[0]) / (drop[np.argmax(q)] - drop[0])
    inside = (q > 0.1) & (q < 0.9)
    assert (share[inside] > 1.1 * q[inside]).all()
    left = np.flatnonzero(way <= 0.5 * way[-1])
    assert (np.diff(share[left]) > 0).all()


def crowns(template, name):
    """[(k, 3) vertices] of the left teeth of a row, from the middle to the back."""
    part = template.part(name)
    vertices = template.vertices[part.vertex_slice]
    tooth = vertex_components(template.faces[part.face_slice] - part.vertices[0], len(vertices))
    found = [vertices[tooth == number] for number in np.unique(tooth)]
    return sorted((own for own in found if own[:, 0].mean() > 0), key=lambda own: -own[:, 2].mean())


@pytest.mark.parametrize(("name", "up"), [("teeth_upper", 1.0), ("teeth_lower", -1.0)])
def test_teeth_end_in_an_even_line(hm08, name, up):
    """As it is seen: no row of splinters behind the incisors."""
    tips = [(up * own[:, 1]).min() for own in crowns(hm08, name)]
    assert len(tips) == 7 and np.abs(np.diff(tips)).max() < 1.0 and min(tips) > tips[0] - 0.8
    for own in crowns(hm08, name)[3:]:
        surface = own[-37:]  # the shoulder, two rings and the middle
        assert 0.8 < np.ptp(surface[:, 1]) < 3.0 and np.ptp(surface[-13:, 1]) < 1.0


@pytest.mark.parametrize(("name", "up"), [("teeth_upper", 1.0), ("teeth_lower", -1.0)])
def test_nothing_is_seen_between_the_middle_incisors(hm08, name, up):
    """But for a groove: from 2 mm beside the edge to 5 mm no ray goes through between them."""
    part = hm08.part(name)
    vertices, faces = hm08.vertices[part.vertex_slice], hm08.faces[part.face_slice] - part.vertices[0]
    edge = (up * crowns(hm08, name)[0][:, 1]).min()
    x, y = np.meshgrid(np.arange(-1.0, 1.01, 0.02), up * (edge + np.arange(2.0, 5.1, 0.5)))
    origins = np.stack([x, y, np.full_like(x, 60.0)], axis=-1).reshape(-1, 3)
    depth = RayScene(vertices, faces).cast(origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)).distance
    assert np.ptp(depth.reshape(x.shape), axis=1).max() < 1.0


def test_upper_arch_has_natural_widths(hm08):
    middles = [own.mean(axis=0) for own in crowns(hm08, "teeth_upper")]
    assert 31.0 < 2 * middles[2][0] < 38.0 and 46.0 < 2 * middles[5][0] < 55.0


def test_rows_of_teeth_bite_on_each_other(hm08):
    """Without going through each other."""
    rows = rows_of_teeth(hm08, hm08.vertices)
    for (_, row), (place, _) in zip(rows, rows[::-1]):
        outside = row.way_out(hm08.vertices[place], row.vertices)[0]
        assert (np.linalg.norm(outside, axis=1) > 0).mean() < 0.02


def test_jaw_carries_teeth_and_tongue_rigidly(hm08):
    jaw_open = hm08.shape("jawOpen")
    assert not jaw_open[hm08.part("teeth_upper").vertex_slice].any()
    for name in ("teeth_lower", "tongue"):
        part = hm08.part(name).vertex_slice
        before, after = hm08.vertices[part], hm08.vertices[part] + jaw_open[part]
        gram = [points - points.mean(axis=0) for points in (before, after)]
        np.testing.assert_allclose(gram[0] @ gram[0].T, gram[1] @ gram[1].T, atol=0.5)
    chin = jaw_open[hm08.regions["face"]].min(axis=0)[1]
    assert -45 < chin < -30


def test_identities_keep_eyes_lips_and_origin(hm08):
    rng = np.random.default_rng(4)
    left, right = hm08.part("eye_left").vertex_slice, hm08.part("eye_right").vertex_slice
    for _ in range(4):
        delta = np.tensordot(rng.standard_normal(len(hm08.identity_basis)), hm08.identity_basis, axes=1)
        np.testing.assert_allclose(delta[left], np.broadcast_to(delta[left][0], delta[left].shape), atol=1e-9)
        np.testing.assert_allclose(delta[left][0] + delta[right][0], 0.0, atol=0.02)
        assert lip_gaps_mm(hm08.vertices + delta, hm08.lines).max() < 0.2


def test_skin_weights_and_skeleton(hm08):
    np.testing.assert_allclose(hm08.skin_weights.sum(axis=1), 1.0)
    assert hm08.skeleton.names == ("neck", "head", "jaw", "eye_left", "eye_right")
    jaw = hm08.skin_weights[:, 2]
    assert jaw[hm08.part("teeth_lower").vertex_slice].min() == 1.0
    assert jaw[hm08.regions["lip_lower"]].mean() > 0.5 > jaw[hm08.regions["lip_upper"]].mean()
    assert hm08.skin_weights[hm08.lines["neck_ring"], 0].min() > 0.9


def test_landmarks_are_symmetric_and_on_the_features(hm08):
    marks = dict(zip(hm08.landmarks.names, hm08.landmarks.positions(hm08.vertices, hm08.faces)))
    assert len(marks) == 478 + 68
    np.testing.assert_allclose(marks["p49"] * FLIP, marks["p55"], atol=0.3)
    corner = hm08.vertices[hm08.lines["lip_seam_upper"][-1]]
    assert np.linalg.norm((marks["p55"] - corner)[:2]) < 3.0
    assert np.linalg.norm((marks["mp473"] - hm08.skeleton.positions[3])[:2]) < 2.5
    nose = hm08.vertices[hm08.vertices[:, 2].argmax()]
    assert np.linalg.norm(marks["p31"] - nose) < 8.0
