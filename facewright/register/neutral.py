"""From the fit to the neutral: the expression that the scan wears is taken out."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from facewright.mesh.adjacency import dilate
from facewright.register.lines import arc_fractions
from facewright.register.nonrigid import ElasticSkin, Rows

# Less than this of a shape is taken for the person's own rest face.
REMOVE_FROM = 0.25
# A vertex that moves less than this (mm) under the removed shapes keeps what the scan says of it; beyond, the model at
# rest gives its place and only the smooth part of the person's own shape is carried on.
KEEP_MM = 0.8
HOLD_FROM_MM, AROUND_MM = 22.0, 30.0
# Of the template's aperture: modelled eyes look alert; opened as wide, a face that was scanned asleep stares.
RELAXED = 0.88


def take_out_expression(template, model, fit_skin, expression):
    """Skin (n, 3) at rest, and what was removed.

    template data.Template; model ModelFit; fit_skin (n, 3) the fitted skin; expression dict shape -> weight found.
    Shapes under REMOVE_FROM stay: what a model calls a tenth of a smile is more likely a face. Lids move only within
    12 mm of their margins, whatever the template's blink does to the rest of the face. Deformation transfer of the way
    back was tried first: it tears where closed lids have triangles without area.
    """
    removed = {name: weight for name, weight in expression.items() if weight >= REMOVE_FROM}
    if not removed:
        return fit_skin, removed
    n = len(fit_skin)
    faces = template.faces[template.skin.face_slice]
    linear = np.asarray(model.T)[:3, :3]
    way = sum(weight * template.shape(name)[:n] for name, weight in removed.items()) @ linear.T
    if all(name.startswith("eyeBlink") for name in removed):
        near = np.zeros(n, bool)
        for name in ("eyes", "socket_left", "socket_right"):
            near |= template.regions[name][:n]
        way = np.where(near[:, None], way, 0.0)
    rest = model.rest[:n]
    moved = np.linalg.norm(way, axis=1)
    inside = ~dilate(template.regions["outer"][:n], faces, 1)
    # Insides follow the model at rest, never the closed pose.
    weights = np.where(inside, 0.0, np.exp(-((moved / KEEP_MM) ** 2)))
    skin = ElasticSkin(rest, faces)
    rows = Rows(sp.identity(n, format="csr"), fit_skin - way, 1e3 * weights * skin.mass)
    opened = rest + skin.solve((rows,), 1.0, 0.2, 1e-4, tolerance=1e-6, max_iterations=10)
    for side in ("Left", "Right"):
        if f"eyeBlink{side}" in removed:
            opened = _template_aperture(template, opened, faces, side.lower())
    return opened, removed


def _template_aperture(template, skin, faces, side):
    """Skin (n, 3) whose lids open nearly as far, for the width of the eye, as the template's; shut lids do not tell."""
    upper, lower = template.lines[f"lid_upper_{side}"], template.lines[f"lid_lower_{side}"]
    over = np.interp(arc_fractions(skin[upper]), arc_fractions(skin[lower]), np.arange(len(lower)))
    partner = lower[np.rint(over).astype(int)]
    opening = [np.linalg.norm(v[upper] - v[partner], axis=1).max() for v in (skin, template.vertices)]
    width = [np.linalg.norm(v[upper[0]] - v[upper[-1]]) for v in (skin, template.vertices)]
    excess = 1.0 - RELAXED * opening[1] * width[0] / width[1] / max(opening[0], 1e-6)
    # The lower lid stays: on shut eyes it is where it was.
    n = len(skin)
    near = np.linalg.norm(skin - skin[upper].mean(axis=0), axis=1)
    hold = np.where(near > HOLD_FROM_MM, 1e3, 0.0)
    hold[lower] = 1e3
    pull = np.zeros((n, 3))
    pull[upper] = excess * (skin[partner] - skin[upper])
    hold[upper] = 1e3
    # Only what is near the eye can move; a strip of what holds is enough around it.
    used, local = np.unique(faces[(near < AROUND_MM)[faces].all(axis=1)], return_inverse=True)
    elastic = ElasticSkin(skin[used], local.reshape(-1, 3))
    rows = Rows(sp.identity(len(used), format="csr"), (skin + pull)[used], hold[used] * elastic.mass)
    opened = skin.copy()
    opened[used] += elastic.solve((rows,), 1.0, 0.2, 1e-4, tolerance=1e-6, max_iterations=10)
    return opened
