"""hm08's raw identity material: what its artists' modifiers and macros do, and random plausible people made of them.

Beside a template's identity modes a folder may hold modifiers.npz: sparse deltas on the control mesh. From them come
the template's own modes, and heads of known truth for benchmarks (identities from modifiers that a test basis leaves
out).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from facewright.errors import InputError
from facewright.template.store import ARRAYS, find_template, npz_bytes

FILE = "modifiers.npz"
# Ends of names that are two directions of one thing; the first is taken as the positive one.
OPPOSITES = (
    ("incr", "decr"),
    ("up", "down"),
    ("forward", "backward"),
    ("out", "in"),
    ("uncompress", "compress"),
    ("convex", "concave"),
    ("2-r", "1-r"),
)
ANCESTRIES = ("african", "asian", "caucasian")
SEXES = ("female", "male")
AGES = ("baby", "child", "young", "old")
AGE_SHARES = (0.02, 0.08, 0.62, 0.28)  # of random people: nearest age
# Standard deviation of a modifier's axis, whose ends are -1 and 1, by how its name starts. Judged by eye on random
# heads: at 0.45 everywhere most are caricatures with flat skulls; asym-* and whole-head axes add up fastest.
SPREAD = 0.26
SPREADS = {"asym-": 0.10, "head-": 0.14, "forehead-": 0.15, "neck-": 0.18, "measure-neck-": 0.15, "chin-": 0.22}


@dataclass(frozen=True)
class Modifiers:
    """names (k,) of modifiers and macros; deltas (k, c, 3) mm on the control mesh; operator (n, c) to the template.

    mean  (k,) weights of the macros that make the template's own neutral; a sample's delta is (w - mean) deltas
    areas (c,) how much surface a control point stands for, face first: the measure in which modes are orthogonal
    mirror (c,) twin of each control point across x = 0
    """

    names: tuple[str, ...]
    deltas: np.ndarray
    operator: sp.csr_matrix
    mean: np.ndarray
    areas: np.ndarray
    mirror: np.ndarray

    def subset(self, names):
        """Only the named modifiers."""
        chosen = [self.names.index(name) for name in names]
        return replace(self, names=tuple(names), deltas=self.deltas[chosen], mean=self.mean[chosen])


def write_modifiers(modifiers, folder):
    """Write Modifiers beside a template (the operator stays in the template's own file)."""
    k = len(modifiers.names)
    flat = modifiers.deltas.reshape(k, -1)
    scale = np.maximum(np.abs(flat).max(axis=1), 1e-9) / 32767.0
    # Steps of 0.002 mm, far below the 0.01 mm of the source files, unless a delta is too large for them.
    scale = np.maximum(scale, 0.002)
    packed = sp.csr_matrix(np.round(flat / scale[:, None]).astype(np.int16))
    content = {
        "names": np.array(modifiers.names, dtype="U64"),
        "scale": scale,
        "values": packed.data,
        "indices": packed.indices.astype(np.uint16),
        "indptr": packed.indptr.astype(np.int32),
        "shape": np.array(modifiers.deltas.shape, np.int32),
        "mean": modifiers.mean,
        "areas": modifiers.areas.astype(np.float32),
        "mirror": modifiers.mirror.astype(np.int32),
    }
    (Path(folder) / FILE).write_bytes(npz_bytes(content))


def read_modifiers(template_folder):
    """Modifiers of a template given by name or folder; InputError if it has none."""
    folder = find_template(template_folder)
    path = folder / FILE
    if not path.is_file():
        raise InputError(f"template: {folder} has no {FILE}; only a template made of modifiers has one (hm08)")
    with np.load(path, allow_pickle=False) as stored:
        shape = tuple(stored["shape"])
        parts = (stored["values"].astype(np.float64), stored["indices"].astype(np.int32), stored["indptr"])
        flat = sp.csr_matrix(parts, shape=(shape[0], shape[1] * 3)).toarray() * stored["scale"][:, None]
        names, mean, areas = stored["names"], stored["mean"], stored["areas"].astype(np.float64)
        mirror = stored["mirror"].astype(np.int64)
    with np.load(folder / ARRAYS, allow_pickle=False) as stored:
        parts = (stored["operator_data"], stored["operator_indices"], stored["operator_indptr"])
        operator = sp.csr_matrix(parts, shape=tuple(stored["operator_shape"]))
    return Modifiers(tuple(str(name) for name in names), flat.reshape(shape), operator, mean, areas, mirror)


def modifier_axes(names):
    """Groups of modifiers that one random number drives: list of (positive name or None, negative name or None).

    A pair of opposites makes one axis; a modifier without an opposite makes a one-sided one. Macros are left out.
    """
    left = [name for name in names if not is_macro(name)]
    known, axes = set(left), []
    while left:
        name = left.pop(0)
        if name not in known:
            continue
        known.discard(name)
        other, positive = _opposite(name)
        if other in known:
            known.discard(other)
            axes.append((name, other) if positive else (other, name))
        else:
            axes.append((name, None))
    return axes


@functools.lru_cache(maxsize=8)
def _axes_of(names):
    return modifier_axes(names)


def _opposite(name):
    """The name of a modifier's opposite (None if it has none) and whether the given one is the positive end."""
    if name.startswith("asym-"):
        return name[:-1] + ("l" if name.endswith("r") else "r"), name.endswith("r")
    for positive, negative in OPPOSITES:
        for end, other in ((positive, negative), (negative, positive)):
            if name.endswith("-" + end):
                return name[: -len(end)] + other, end == positive
    return None, True


def is_macro(name):
    """Whether a name is one of the age, sex, ancestry, muscle and weight targets."""
    return name.split("-")[0] in (*ANCESTRIES, "universal")


def sample_weights(rng, names):
    """(k,) random plausible weights of the named modifiers and macros (rng: a numpy Generator).

    Both sides of a face agree but for a fifth of what they vary.
    """
    index = {name: i for i, name in enumerate(names)}
    weights = np.zeros(len(names))
    shared = {}
    for positive, negative in _axes_of(tuple(names)):
        spread = next((value for start, value in SPREADS.items() if positive.startswith(start)), SPREAD)
        amount = float(np.clip(rng.normal(0.0, spread), -1.0, 1.0))
        if positive[:2] in ("l-", "r-"):
            common = shared.setdefault(positive[2:], amount)
            amount = float(np.clip(common + rng.normal(0.0, 0.2 * spread), -1.0, 1.0))
        if amount >= 0:
            weights[index[positive]] = amount
        elif negative is not None:
            weights[index[negative]] = -amount
        else:
            weights[index[positive]] = 0.3 * amount  # one-sided: a little of the opposite is as plausible
    for name, value in sample_macros(rng).items():
        if name in index:
            weights[index[name]] = value
    return weights


def sample_macros(rng):
    """dict name -> weight of one random person's ancestry, sex, age, muscle and weight."""
    ancestry = dict(zip(ANCESTRIES, rng.dirichlet([0.6] * 3)))
    male = rng.beta(0.5, 0.5)
    sex = {"female": 1 - male, "male": male}
    age = dict.fromkeys(AGES, 0.0)
    stage = int(rng.choice(4, p=AGE_SHARES))
    near = int(np.clip(stage + rng.choice([-1, 1]), 0, 3))
    share = rng.uniform(0.0, 0.5)
    age[AGES[stage]] += 1 - share
    age[AGES[near]] += share
    levels = [_three_levels(rng.normal(0.0, 0.45)) for _ in range(2)]
    out = {}
    for s in SEXES:
        for a in AGES:
            for c in ANCESTRIES:
                out[f"{c}-{s}-{a}"] = ancestry[c] * sex[s] * age[a]
            for muscle, m in levels[0].items():
                for weight, w in levels[1].items():
                    out[f"universal-{s}-{a}-{muscle}muscle-{weight}weight"] = sex[s] * age[a] * m * w
    return out


def _three_levels(value):
    value = float(np.clip(value, -1.0, 1.0))
    return {"min": max(-value, 0.0), "average": 1.0 - abs(value), "max": max(value, 0.0)}


def mean_weights(names):
    """(k,) weights of the adult mean: young, both sexes, three ancestries, average muscle and weight."""
    macros = {f"{c}-{s}-young": 1 / 6 for c in ANCESTRIES for s in SEXES}
    macros |= {f"universal-{s}-young-averagemuscle-averageweight": 1 / 2 for s in SEXES}
    return np.array([macros.get(name, 0.0) for name in names])


def sample_identity(modifiers, rng, names=None):
    """(n, 3) mm delta of one random person from the template's neutral; only the named modifiers vary."""
    chosen = modifiers if names is None else modifiers.subset(names)
    weights = sample_weights(rng, chosen.names) - chosen.mean
    return chosen.operator @ np.tensordot(weights, chosen.deltas, axes=1)


def split_names(names, fifth=0):
    """(kept, left out): every fifth axis of modifiers goes out, with both its ends and both its sides; macros stay."""
    axes = modifier_axes(names)
    stems = sorted({(p[2:] if p[:2] in ("l-", "r-") else p) for p, _ in axes})
    out_stems = set(stems[fifth::5])
    out = {n for p, q in axes if (p[2:] if p[:2] in ("l-", "r-") else p) in out_stems for n in (p, q) if n}
    return [n for n in names if n not in out], [n for n in names if n in out]


def build_modes(modifiers, names=None, n_modes=100, *, n_samples=3000, seed=0):
    """(n_modes, c, 3) control deltas: principal components of random people, one standard deviation each.

    Each sample counts with its mirror image, so modes are symmetric or antisymmetric. Orthogonal in the measure of
    modifiers.areas; the mean of the samples is not taken out: the neutral stays the centre.
    """
    chosen = modifiers if names is None else modifiers.subset(names)
    rng = np.random.default_rng(seed)
    W = np.stack([sample_weights(rng, chosen.names) for _ in range(n_samples)]) - chosen.mean
    W = W - W.mean(axis=0)
    c = chosen.deltas.shape[1]
    C = W.T @ W / n_samples
    values, vectors = np.linalg.eigh(C)
    keep = values > values.max() * 1e-12
    half = vectors[:, keep] * np.sqrt(values[keep])  # C = half half^T
    fields = np.tensordot(half.T, chosen.deltas, axes=1).reshape(-1, c, 3)
    fields = np.concatenate([fields, fields[:, chosen.mirror] * [-1, 1, 1]]) / np.sqrt(2.0)
    measure = np.sqrt(chosen.areas / chosen.areas.sum())[None, :, None]
    flat = (fields * measure).reshape(len(fields), -1)
    values, vectors = np.linalg.eigh(flat @ flat.T)
    order = np.argsort(values)[::-1][:n_modes]
    modes = np.tensordot(vectors[:, order].T, fields, axes=1)
    # The sign is free: an arbitrary fixed direction decides, and steps of 0.0001 mm swallow the rounding of threads,
    # so that the same material gives the same bytes.
    signs = np.sign(modes.reshape(len(modes), -1) @ np.cos(np.arange(3.0 * c)))
    return np.round(modes * signs[:, None, None], 4) + 0.0  # no negative zeros


def build_basis(modifiers, names=None, n_modes=100, **options):
    """(n_modes, n, 3) identity basis of the template's vertices from the named modifiers; see build_modes."""
    modes = build_modes(modifiers, names, n_modes, **options)
    return np.stack([modifiers.operator @ mode for mode in modes])
