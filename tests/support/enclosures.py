"""Random intervals, points in them, and whether an interval holds exact values."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.intervals import (
    Interval,
)

LARGEST = Fraction(float(np.finfo(float).max))


def floats(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Of all sizes: ordinary ones, zeros, subnormal ones, ones whose products overflow or underflow."""
    x = rng.normal(size=shape) * 10.0 ** rng.integers(-3, 4, size=shape)
    odd = rng.choice([0.0, -0.0, 1.0, -1.0, 5e-324, -3e-310, 1e-200, -1e-160, 1e160, -1e300, 2.0**-52, 3.0], size=shape)
    return np.where(rng.uniform(size=shape) < 0.3, odd, x)


def intervals(rng: np.random.Generator, shape: tuple[int, ...]) -> Interval:
    """Thin ones, narrow ones and wide ones."""
    a = floats(rng, shape)
    b = np.where(
        rng.uniform(size=shape) < 0.3, a, np.where(rng.uniform(size=shape) < 0.5, a * (1 + 1e-15), floats(rng, shape))
    )
    return Interval.between(np.minimum(a, b), np.maximum(a, b))


def points(rng: np.random.Generator, x: Interval) -> list[Array]:
    """Float arrays within: both ends, and some between."""
    inner = [np.clip(x.lo + rng.uniform(size=x.shape) * (x.hi - x.lo), x.lo, x.hi) for _ in range(3)]
    mixed = np.where(rng.uniform(size=x.shape) < 0.5, x.lo, x.hi)
    return [x.lo, x.hi, mixed, *inner]


def exact(x: Array) -> Array:
    out = np.empty(x.shape, dtype=object)
    out.ravel()[:] = [Fraction(v) for v in np.ravel(x).tolist()]
    return out


def holds(x: Interval, values: Array) -> bool:
    """Is every fraction inside, or out of the range of floats and its interval without a bound?"""
    ends = zip(x.lo.ravel().tolist(), np.ravel(values), x.hi.ravel().tolist(), strict=True)
    return x.shape == np.shape(values) and all(_holds(*each) for each in ends)


def _holds(lo: float, v: Fraction, hi: float) -> bool:
    if math.isnan(lo) or math.isnan(hi):  # proves nothing, and may only come of overflow
        return abs(v) > LARGEST / 2**60
    return (lo == -math.inf or Fraction(lo) <= v) and (hi == math.inf or v <= Fraction(hi))


def balls(x: Array) -> Array:
    arb = pytest.importorskip("flint").arb
    return np.array([arb(v) for v in np.ravel(x).tolist()], dtype=object).reshape(np.shape(x))


def encloses(x: Interval, values: Array, by: float = 0.0) -> bool:
    ends = zip(balls(x.lo).ravel(), np.ravel(values), balls(x.hi).ravel(), strict=True)
    return x.shape == np.shape(values) and all(lo - by <= v and v <= hi + by for lo, v, hi in ends)
