"""Polynomials of two parameters in Bernstein form: (M+1, N+1, ...) coefficients over the unit square."""

from __future__ import annotations

from math import comb

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import cross_rows

PADDING = 1e-13  # of the size of a patch: more than the rounding of a subdivision


def evaluate(points: Array, u: object, v: object) -> Array:
    """The polynomial with Bernstein coefficients `points` (M+1, N+1, k) at u, v: (..., k)."""
    a = bernstein(points.shape[0] - 1, np.asarray(u, dtype=float))
    b = bernstein(points.shape[1] - 1, np.asarray(v, dtype=float))
    return np.einsum("...i,...j,ijk->...k", a, b, points)


def bernstein(degree: int, x: Array) -> Array:
    """(..., degree+1) the Bernstein polynomials B_i(x) of a degree."""
    i = np.arange(degree + 1)
    x = np.asarray(x)[..., None]
    return np.array([comb(degree, k) for k in i]) * x**i * (1 - x) ** (degree - i)


def differences(points: Array, du: int, dv: int) -> Array:
    """Bernstein coefficients of a derivative: (M+1-du, N+1-dv, k); zeros (1, ...) beyond the degree."""
    out = points
    for _ in range(du):
        out = (out.shape[0] - 1) * np.diff(out, axis=0) if out.shape[0] > 1 else 0 * out
    for _ in range(dv):
        out = (out.shape[1] - 1) * np.diff(out, axis=1) if out.shape[1] > 1 else 0 * out
    return out


def restrict(points: Array, u: tuple[float, float], v: tuple[float, float]) -> Array:
    """Bernstein coefficients of the polynomial over a rectangle of parameters (blossoming)."""
    return _restrict_first(_restrict_first(points, *u).swapaxes(0, 1), *v).swapaxes(0, 1)


def hull_box(points: Array) -> Array:
    """(2, k) box about all values of a polynomial over the unit square, padded against rounding."""
    flat = points.reshape(-1, points.shape[-1])
    pad = PADDING * np.abs(flat).max(initial=0.0)
    return np.array([flat.min(axis=0) - pad, flat.max(axis=0) + pad])


def largest_derivatives(points: Array, cells: int) -> Array:
    """(5,) bounds of a vector polynomial's derivatives (1, 0), (0, 1), (2, 0), (1, 1), (0, 2) in one cell.

    points: over one of cells x cells equal parts of the unit square; derivatives: by the parameters of the whole.
    """
    orders = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    return np.array([cells ** sum(o) * np.linalg.norm(differences(points, *o), axis=2).max() for o in orders])


def least_length(n: Array, depth: int = 0) -> float:
    """A positive lower bound of |n| for a vector polynomial of which it is known that it vanishes nowhere."""
    along = n.reshape(-1, 3).mean(axis=0)
    along /= np.linalg.norm(along)
    value = float((n @ along).min())
    if value > 0 or depth == 8:
        return max(value, 1e-30)
    halves = ((0.0, 0.5), (0.5, 1.0))
    return min(least_length(restrict(n, u, v), depth + 1) for u in halves for v in halves)


def _restrict_first(points: Array, a: float, b: float) -> Array:
    """Over [a, b] in the first parameter: coefficient k is the blossom at k times b and the rest a."""
    degree = len(points) - 1
    out = np.empty_like(points)
    for k in range(degree + 1):
        level = points
        for x in [b] * k + [a] * (degree - k):
            level = (1 - x) * level[:-1] + x * level[1:]
        out[k] = level[0]
    return out


def product(a: Array, b: Array) -> Array:
    """Bernstein coefficients of the cross product of two vector polynomials (Yamaguchi 1997)."""
    a, b = a * _binomials(a)[:, :, None], b * _binomials(b)[:, :, None]
    out = np.zeros((a.shape[0] + b.shape[0] - 1, a.shape[1] + b.shape[1] - 1, 3))
    for i, j in np.ndindex(*a.shape[:2]):
        out[i : i + b.shape[0], j : j + b.shape[1]] += cross_rows(a[i, j], b)
    return out / _binomials(out)[:, :, None]


def _binomials(points: Array) -> Array:
    """(M+1, N+1) products of the binomial coefficients of a polynomial's degrees."""
    rows, columns = (np.array([float(comb(n - 1, k)) for k in range(n)]) for n in points.shape[:2])
    return np.outer(rows, columns)
