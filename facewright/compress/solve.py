"""Difference textures and weight maps of a set as they are stored: exact, refined, or of constant weights (PCA)."""

from __future__ import annotations

from functools import partial

import numpy as np

from facewright.compress.refine import PASSES, RIDGE, gram_matrix, pca_weights, refine, settle
from facewright.compress.store import SETTLING_TAIL, measure_tiles, root_mean, store_solution, texture_rounding
from facewright.compress.tiles import CELL

# Difference textures with the finer weight maps, and how many blocks tell whether they leave less than four would.
FINE_TEXTURES, BLOCKS = 3, 400
# Of exact solutions and constant weights, which need no damping.
LEAST_RIDGE = 1e-6
# Where the refined error is below this share of that of PCA(K), every texture shall gain.
CLEAR_GAIN = 0.8
# A texture that does not is counted more, a few times, by this power of its error over a share of that in PCA(K). On
# five sets two turns did it (power 1: three to four; 1.5 costs more of the mean; going on from the last weights with
# few passes: five turns and not on all).
AIM, POWER, TURNS = 0.98, 1.25, 4


def solve_pca(tiles, k):
    """What is stored of constant weights, and the RMSE (N, C) of every texture and channel."""
    result = _store_pca(tiles, gram_matrix(tiles), k)
    return result, measure_tiles(tiles, result)


def solve_refined(tiles, k, iterations, held, plain, finer, progress):
    """What is stored of the refined solution, and the RMSE (N, C) of every texture and channel.

    held    textures that difference textures 0, 1, ... hold exactly
    plain   RMSE counts every texel and channel alike, so that PCA(K) is a measure
    finer   function () -> the same textures in tiles of FINE_CELL, where FINE_TEXTURES with weights at a quarter are
            open besides K with weights at an eighth; else None
    """
    gram = gram_matrix(tiles)
    exact = _exact_basis(tiles, gram, k, held)
    share = partial(progress, "refining")
    if exact is None and finer is not None and _finer_pays(tiles, k):
        result, errors = _from_pca(finer(), gram, FINE_TEXTURES, iterations, share)
        if not plain or _no_worse(root_mean(errors), pca_rmse(tiles, gram, k)):
            return result, errors
    if exact is not None:
        exact = np.broadcast_to(exact, (*tiles.grid.cells, *exact.shape))
        result = store_solution(tiles, exact, LEAST_RIDGE, exact=True, report={"solution": "exact"})
        return result, measure_tiles(tiles, result)
    result, errors = _from_pca(tiles, gram, k, iterations, share, held)
    if plain and not held:
        return _no_worse_than_pca(tiles, gram, iterations, progress, result, errors)
    return result, errors


def _finer_pays(tiles, k):
    """Whether rank FINE_TEXTURES leaves less of the quarters of tiles than rank K of whole ones."""
    some = np.flatnonzero(tiles.scale.any(axis=(1, 2)))
    some = some[np.unique(np.linspace(0, len(some) - 1, BLOCKS).astype(int))]
    half, t, n = CELL // 2, len(some), tiles.count
    quarters = tiles.differences(some).reshape(t, n, -1, 2, half, 2, half).transpose(0, 3, 5, 1, 2, 4, 6)
    quarters = quarters.reshape(t, 4, n, -1)
    grams = quarters @ quarters.transpose(0, 1, 3, 2)
    fine = np.linalg.eigvalsh(grams)[..., :-FINE_TEXTURES].sum()
    return bool(fine < np.linalg.eigvalsh(grams.sum(axis=1))[..., :-k].sum())


def _from_pca(tiles, gram, k, iterations, share, held=()):
    """The refined solution that starts from the K leading components, as _refined() gives it."""
    start = pca_weights(gram, k)
    start[list(held)] = 0
    start[:, : len(held)] = 0
    start[list(held), range(len(held))] = 1
    return _refined(tiles, start, ridge_for(gram, k), iterations, share, float(gram.trace()), held)


def _refined(tiles, start, ridge, passes, share, energy=0.0, held=()):
    """The refined solution as stored, and its errors; textures count as tiles.emphasis says."""
    emphasis = np.float32(1) if tiles.emphasis is None else tiles.emphasis
    weights, values = refine(
        tiles, start * emphasis, energy=energy, iterations=passes, ridge=ridge, keep=held, progress=share
    )
    if values:
        whole = range(len(held))
        rounding = texture_rounding(tiles, weights, ridge, held, whole, SETTLING_TAIL)
        weights = settle(tiles, weights, rounding.of_part, ridge=ridge, keep=held)
    weights /= emphasis
    # Few textures leave little noise to damp: a smaller ridge in the end then costs no range.
    last = min(ridge, 1e-4) if tiles.count <= 4 else ridge
    result = store_solution(tiles, weights, last, held=held, report={"solution": "refined", "passes": len(values)})
    return result, measure_tiles(tiles, result)


def _no_worse(rmse, wanted):
    """Whether no texture of RMSE (N,) is worse than wanted (N,), or, where little is gained, the mean is not."""
    clear = rmse.mean() <= CLEAR_GAIN * wanted.mean()
    return bool((rmse <= wanted).all() if clear else rmse.mean() <= wanted.mean())


def _no_worse_than_pca(tiles, gram, iterations, progress, result, errors):
    """The refined solution, or one that makes no texture worse than PCA(K) does, or PCA(K) itself where it is better.

    A few strong textures govern constant weights, which then hold them almost exactly; the least sum of squares gives
    some of that up. Where refining gains much on the whole, these textures are made to count more until they gain too.
    """
    k = len(result["textures"])
    rmse, wanted = root_mean(errors), pca_rmse(tiles, gram, k)
    if _no_worse(rmse, wanted):
        return result, errors
    constant = _store_pca(tiles, gram, k)
    constant_errors = measure_tiles(tiles, constant)
    if rmse.mean() > CLEAR_GAIN * wanted.mean():
        better = root_mean(constant_errors).mean() < rmse.mean()
        return (constant, constant_errors) if better else (result, errors)
    # Half a code is rounding.
    wanted = np.maximum(root_mean(constant_errors), 0.5 * tiles.unit)
    ratio, emphasis, start = rmse / wanted, np.ones(tiles.count), pca_weights(gram, k)
    worst = ratio.max()
    passes = PASSES if iterations is None else iterations
    ridge = ridge_for(gram, k)
    for turn in range(TURNS):
        if worst < 1:
            break
        emphasis = emphasis * np.maximum(ratio / AIM, 1) ** POWER
        tiles.emphasis = (emphasis / np.sqrt((emphasis**2).mean())).astype(np.float32)[:, None]
        # What is held almost exactly shows the damping: where two turns are not enough there is less of it.
        damping = ridge if turn < 2 else 0.5 * ridge
        share = partial(progress, f"evening out {turn + 1}")
        trial, trial_errors = _refined(tiles, start, damping, passes, share)
        tiles.emphasis = None
        ratio = root_mean(trial_errors) / wanted
        if ratio.max() < worst and root_mean(trial_errors).mean() <= CLEAR_GAIN * root_mean(constant_errors).mean():
            result, errors, worst = trial, trial_errors, ratio.max()
    return result, errors


def ridge_for(gram, k):
    """Ridge of the difference textures per texture: RIDGE, less where K components leave next to nothing of the energy
    (the damping would be most of the error) and for few textures, which leave little noise to damp."""
    values = np.maximum(np.linalg.eigvalsh(gram), 0)
    left = values[:-k].sum() / max(values.sum(), 1e-30)
    return float(np.clip(RIDGE * left / 0.05, LEAST_RIDGE, RIDGE))


def _store_pca(tiles, gram, k):
    start = pca_weights(gram, k)
    constant = np.broadcast_to(start, (*tiles.grid.cells, *start.shape))
    return store_solution(tiles, constant, LEAST_RIDGE, report={"solution": "pca"})


def pca_rmse(tiles, gram, k):
    """(N,) RMSE of every texture when the k leading components are kept in float, from the (N, N) Gram matrix."""
    values, vectors = np.linalg.eigh(gram)
    left = np.diag(gram) - (vectors[:, -k:] ** 2 * values[-k:]).sum(axis=1)
    return np.sqrt(np.maximum(left, 0) / (max((tiles.scale > 0).sum(), 1) * tiles.channels))


def _exact_basis(tiles, gram, k, held):
    """Constant weights where K of the textures span all (or there are no more than K), else None."""
    n = len(gram)
    rest, chosen = gram.copy(), []
    limit = 1e-9 * max(gram.trace(), 1e-30)
    for step in range(min(k, n)):
        pivot = held[step] if step < len(held) else int(np.argmax(np.diag(rest)))
        if rest[pivot, pivot] <= limit and step >= len(held):
            break
        chosen.append(pivot)
        rest = rest - np.outer(rest[:, pivot], rest[pivot]) / max(rest[pivot, pivot], 1e-30)
    texels = max(float((tiles.scale > 0).sum()) * tiles.channels, 1.0)
    if n > k and np.sqrt(max(np.diag(rest).max(), 0) / texels) > 0.6 * tiles.unit:
        return None
    weights = np.zeros((n, max(len(chosen), 1)))  # no more difference textures than it takes
    if chosen:
        weights[:] = np.linalg.lstsq(gram[np.ix_(chosen, chosen)], gram[chosen], rcond=1e-12)[0].T
        weights[chosen] = np.eye(len(chosen))
    return weights
