"""More identity modes from a template's own: the same variation, allowed to differ from place to place.

A basis of whole-head modes ties the jaw to the forehead: a person beside its span is met by sliding the skin. So part
of the variance is given to localised modes. The prior covariance becomes

    K(x, y) = (1 - share) C(x, y) + share C(x, y) exp(-|x - y|^2 / (2 length^2)),   C = sum_i b_i(x) b_i(y)'

(Luethi, Gerig, Jud and Vetter, Gaussian process morphable models, 2018, section 3.4: localised kernels), with the
Gaussian as a sum of smooth windows, sum_r w_r(x) w_r(y), so that windowed modes span it; principal components keep it
small. Mean error of the face on the ten heads a template of known truth (bench/registration_truth.py), without the
refinement of refine.py: 12 windows, 60 mm, a share of 0.05 and 200 modes 0.92 mm (hm08) and 0.80 (ICT); 40 windows,
40 mm, 0.2 and 600 modes, matched with a smoothed scan, 0.90 and 0.72. A share of 0.5, lengths of 25 to 110 mm and
mixtures of them were tried with 200 modes: hm08 gains as much, ICT loses more, and shorter lengths fit noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

WINDOWS, LENGTH_MM, SHARE, MODES = 40, 40.0, 0.2, 600
WIDE_MODES = 20
"""Only the first modes are localised: the rest are local already."""
SAMPLES, OUTSIDE_WEIGHT = 1200, 0.3


@dataclass(frozen=True)
class LocalizedBasis:
    """j identity modes of a head of n vertices, one standard deviation each, as mixtures of a template's own i modes,
    wide, and of the first w of them seen through r windows. Written out they fill 150 MB, of which little is asked for.

    basis (i, n, 3) mm, windows (n, r), mixture (j, i + w r)
    """

    basis: np.ndarray
    windows: np.ndarray
    mixture: np.ndarray

    def __len__(self):
        return len(self.mixture)

    def first(self, count):
        """The LocalizedBasis of the strongest count modes."""
        return replace(self, mixture=self.mixture[:count])

    def at(self, rows):
        """(j, k, 3) the modes at vertices rows (k,)."""
        # Single precision is off by 1e-5 mm, and takes half the time.
        pieces = _pieces(self.basis[:, rows].astype(np.float32), self.windows[rows].astype(np.float32))
        mixed = self.mixture.astype(np.float32) @ pieces.reshape(len(pieces), -1)
        return mixed.reshape(len(self), len(rows), 3).astype(float)

    def along(self, alpha, rows=slice(None)):
        """(n, 3) the displacement of the head, or of rows (a slice) of it, by alpha (j,) deviations of each mode."""
        shares = alpha @ self.mixture  # (i + w r,)
        i, r = len(self.basis), self.windows.shape[1]
        result = np.tensordot(shares[:i], self.basis[:, rows], 1)
        for mode, share in zip(self.basis, shares[i:].reshape(-1, r)):
            result += (self.windows[rows] @ share)[:, None] * mode[rows]
        return result


def localized_basis(vertices, basis, face, outer, *, n_windows=WINDOWS, length_mm=LENGTH_MM, share=SHARE, modes=MODES):
    """LocalizedBasis of the covariance above.

    vertices (n, 3) mm, basis (i, n, 3); face, outer (n,) bool: where components are told apart, the face counting more
    """
    if not len(basis):
        return LocalizedBasis(basis, np.zeros((len(vertices), 0)), np.zeros((0, 0)))
    windows = _windows(vertices, outer, n_windows, length_mm)
    rows = np.flatnonzero(face | outer)
    rows = rows[:: max(1, len(rows) // SAMPLES)]
    measure = np.sqrt(np.where(face[rows], 1.0, OUTSIDE_WEIGHT))[None, :, None]
    pieces = _pieces(basis[:, rows], windows[rows])
    scale = np.where(np.arange(len(pieces)) < len(basis), np.sqrt(1 - share), np.sqrt(share))
    flat = (scale[:, None, None] * pieces * measure).reshape(len(pieces), -1)
    values, vectors = np.linalg.eigh(flat @ flat.T)
    vectors = vectors[:, np.argsort(values)[::-1][: min(modes, len(values))]].T  # (j, i + w r)
    return LocalizedBasis(basis, windows, vectors * scale)


def _pieces(basis, windows):
    """(i + w r, k, 3): the modes (i, k, 3), then the first w of them through windows (k, r)."""
    local = basis[:WIDE_MODES, None] * windows.T[None, :, :, None]  # (w, r, k, 3)
    return np.concatenate([basis, local.reshape(-1, *basis.shape[1:])])


def _windows(vertices, outer, count, length_mm):
    """(n, r) smooth windows about points spread over the outer skin; the squares of a row sum to one."""
    skin = vertices[outer]
    centers = [skin[skin[:, 2].argmax()]]
    distance = np.full(len(skin), np.inf)
    for _ in range(count - 1):
        distance = np.minimum(distance, np.linalg.norm(skin - centers[-1], axis=1))
        centers.append(skin[distance.argmax()])
    squared = ((vertices[:, None] - np.array(centers)[None]) ** 2).sum(axis=2)
    windows = np.exp(-squared / length_mm**2)  # of a product of two: exp(-|x - y|^2 / (2 length^2)) about the centre
    return windows / np.sqrt((windows**2).sum(axis=1, keepdims=True))
