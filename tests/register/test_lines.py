import numpy as np

from facewright.register.lines import CreaseOptions, arc_fractions, resample_line, trace_crease


def grooved_sheet(height, depth=1.5, width=1.2, span=24.0, step=0.5, floor=-np.inf):
    """A sheet in the x-y plane with a groove along y = height(x) for |x| < span, filled up to a floor (x, y)."""
    x, y = np.meshgrid(np.arange(-40, 40, step), np.arange(-20, 20, step))
    z = -depth * np.exp(-(((y - height(x)) / width) ** 2)) * (np.abs(x) < span)
    z = np.maximum(z, floor(x, y) if callable(floor) else floor)
    V = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    i = np.arange(x.size).reshape(x.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    return V, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def wave(x):
    return 2.0 * np.cos(x / 12.0)


def traced(V, F, aside):
    """The crease found from a line that lies aside of the wave, and its points that are not near its ends."""
    x = np.linspace(-22, 22, 30)
    start = np.stack([x, wave(x) + aside, 0 * x], axis=1)
    crease = trace_crease(V, F, start, np.array([0.0, 0.0, 1.0]))
    return crease, crease.points[np.abs(crease.points[:, 0]) < 20]


def test_the_groove_is_found_from_a_line_two_millimetres_off():
    V, F = grooved_sheet(wave)
    crease, inner = traced(V, F, 2.0)
    assert crease.found
    assert np.abs(inner[:, 1] - wave(inner[:, 0])).max() < 0.4
    assert abs(crease.points[0, 0] + 24) < 1.5 and abs(crease.points[-1, 0] - 24) < 1.5


def test_the_middle_of_a_filled_groove_is_followed():
    """Its floor is a little uneven, so that now one edge is deeper, now the other."""

    def floor(x, y):
        return -0.7 + 0.05 * np.sin(x / 2.5) * (y - wave(x))

    V, F = grooved_sheet(wave, depth=2.2, width=1.0, floor=floor, step=0.25)
    crease, inner = traced(V, F, 1.0)
    assert crease.found
    assert np.abs(inner[:, 1] - wave(inner[:, 0])).mean() < 0.25


def test_a_flat_sheet_has_no_crease():
    V, F = grooved_sheet(wave, depth=0.0)
    x = np.linspace(-22, 22, 30)
    start = np.stack([x, 0 * x, 0 * x], axis=1)
    assert not trace_crease(V, F, start, np.array([0.0, 0.0, 1.0]), CreaseOptions()).found


def test_resampling_by_arc_length():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0]])
    assert np.allclose(arc_fractions(line), [0, 1 / 3, 1])
    assert np.allclose(resample_line(line, [0, 0.5, 1])[:, 0], [0, 1.5, 3])
