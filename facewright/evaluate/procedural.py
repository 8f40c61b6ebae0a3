"""Seeded noise in space: the same numbers on every machine, smooth in between, no texture files."""

from __future__ import annotations

import numpy as np

from facewright.mesh.fade import smooth_step

_PRIMES = np.array([0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D], dtype=np.uint64)
_MASK = np.uint64(0xFFFFFFFF)


def lattice_hash(cells, seed):
    """(k,) numbers in 0..1 for integer lattice cells (k, 3): a 32-bit avalanche hash, not a generator with a state."""
    mixed = (cells.astype(np.int64).astype(np.uint64) * _PRIMES).sum(axis=1) + np.uint64(seed * 0x27D4EB2F & 0xFFFFFFFF)
    mixed &= _MASK
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        mixed = ((mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)) & _MASK
    return (mixed ^ (mixed >> np.uint64(16))).astype(np.float64) / 4294967295.0


def value_noise(points, scale, seed=0):
    """(k,) smooth noise in -1..1 at points (k, 3); scale in mm between independent values."""
    cell_position = np.asarray(points, float) / scale
    base = np.floor(cell_position)
    t = smooth_step(cell_position - base)
    result = np.zeros(len(cell_position))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(np.array(corner) == 1, t, 1 - t), axis=1)
        result += weight * lattice_hash(base.astype(np.int64) + np.array(corner), seed)
    return 2 * result - 1


def fractal_noise(points, scale, seed=0, octaves=3):
    """(k,) sum of value noises, each half as large and half as strong as the one before; about -1..1."""
    total, strength = np.zeros(len(points)), 1.0
    for octave in range(octaves):
        total += strength * value_noise(points, scale / 2**octave, seed + 17 * octave)
        strength /= 2
    return total / (2 - 2 ** (1 - octaves))


def speckles(points, spacing, radius, seed=0, share=1.0):
    """(k,) in 0..1: soft round spots of a radius (mm), one in a share of the cubic cells of `spacing` mm."""
    position = np.asarray(points, float) / spacing
    base = np.floor(position).astype(np.int64)
    result = np.zeros(len(position))
    for offset in np.ndindex(3, 3, 3):
        cell = base + np.array(offset) - 1
        place = cell + np.stack([lattice_hash(cell, seed + axis) for axis in range(3)], axis=1)
        present = lattice_hash(cell, seed + 3) < share
        size = radius * (0.5 + lattice_hash(cell, seed + 4))
        distance = np.linalg.norm(position - place, axis=1) * spacing
        result = np.maximum(result, present * np.clip(1.5 - distance / size, 0, 1))
    return np.minimum(result, 1.0)
