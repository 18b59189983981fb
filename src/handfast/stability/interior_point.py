"""Small convex programs over second-order cones, by an interior-point method; what it ends at is inside where it can be.

Source: L. Vandenberghe, The CVXOPT linear and quadratic cone program solvers, 2010, sections 4, 5 and 7: a primal-dual
path with Nesterov-Todd scaling and Mehrotra's correction. Every cone has four numbers here, the first at least the
length of the others; of shorter ones the last are zero, of an inequality all but the first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array

SIZE = 4  # numbers of a cone
STEPS = 60
SHORT = 0.99  # of the longest step
FEASIBLE = 1e-11  # what equations may miss, times the largest of their terms
UNFELT = 1e-12  # coefficients that are none
SIGNS = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Cones:
    """Which points x (n,) are inside of K cones: offset + rows x is in each of them.

    Attributes:
        rows: (K, 4, n). offset: (K, 4).
    """

    rows: Array
    offset: Array

    def with_(self, other: Cones) -> Cones:
        """Those of both."""
        return Cones(np.concatenate([self.rows, other.rows]), np.concatenate([self.offset, other.offset]))

    def felt(self) -> Cones:
        """Those of which x decides anything."""
        some = (np.abs(self.rows) > UNFELT).any(axis=(1, 2))
        return Cones(self.rows[some], self.offset[some])

    def at(self, x: Array) -> Array:
        """(K, 4) what has to be in the cones."""
        return self.offset + self.rows @ x

    def room(self, x: Array) -> Array:
        """(K,) how far inside x is; negative outside."""
        s = self.at(x)
        return s[:, 0] - _length(s[:, 1:])


def minimum(cones: Cones, cost: Array, quadratic: Array, end: float) -> Array | None:
    """The x (n,) inside of cones where x^T quadratic x / 2 + cost @ x is smallest.

    Args:
        end: where the path ends: how far inside x is, times the multiplier, at each cone. The larger, the farther
            inside x stays, and the farther from the smallest.

    Returns:
        None if the path does not come there, as where nothing is inside.
    """
    G = -cones.rows.reshape(-1, len(cost))
    with np.errstate(all="ignore"):  # numbers that overflow end the path
        return _followed(G, cones.offset, cost, quadratic, end)


def _followed(G: Array, h: Array, cost: Array, quadratic: Array, end: float) -> Array | None:
    """The end of the path to the smallest x^T quadratic x / 2 + cost @ x with h (K, 4) - G x in the cones."""
    K = len(h)
    unit = np.zeros((K, SIZE))
    unit[:, 0] = 1.0
    x = np.linalg.lstsq(quadratic + G.T @ G, G.T @ h.ravel() - cost, rcond=None)[0]
    s = h - (G @ x).reshape(K, SIZE)
    z = -s
    s, z = _moved_inside(s), _moved_inside(z)
    scale = 1.0 + float(np.abs(h).max()), 1.0 + float(np.abs(cost).max())
    for _ in range(STEPS):
        mu = float((s * z).sum()) / K
        missing_x = quadratic @ x + cost + G.T @ z.ravel()
        missing_s = s + (G @ x).reshape(K, SIZE) - h
        small = np.abs(missing_s).max() <= FEASIBLE * scale[0] and np.abs(missing_x).max() <= 1e-8 * scale[1]
        if small and mu <= 1.5 * end:
            return x
        W, inverse = _scaling(s, z)
        scaled = _times(W, z)
        GW = (inverse @ G.reshape(K, SIZE, -1)).reshape(K * SIZE, -1)
        H = quadratic + GW.T @ GW
        try:
            factor = np.linalg.inv(H)
        except np.linalg.LinAlgError:
            return None

        def step(right: Array) -> tuple[Array, Array, Array]:
            y = _divided(scaled, right)
            known = _times(inverse, missing_s) - y
            dx = factor @ (-missing_x - GW.T @ known.ravel())
            wdz = (GW @ dx).reshape(K, SIZE) + known
            return dx, wdz, -y - wdz

        square = _product(scaled, scaled)
        _, wdz, wds = step(square)
        a = min(1.0, _longest(scaled, wds), _longest(scaled, wdz))
        centre = max((1 - a) ** 3 * mu, end)
        dx, wdz, wds = step(square + _product(wds, wdz) - centre * unit)
        a = min(1.0, SHORT * min(_longest(scaled, wds), _longest(scaled, wdz)))
        x = x + a * dx
        s, z = s + a * _times(W, wds), z + a * _times(inverse, wdz)
        if not (np.isfinite(x).all() and np.isfinite(s).all() and np.isfinite(z).all()):
            return None
    return None


def _length(v: Array) -> Array:
    out: Array = np.sqrt((v * v).sum(axis=-1))
    return out


def _times(W: Array, s: Array) -> Array:
    out: Array = (W @ s[:, :, None])[:, :, 0]
    return out


def _moved_inside(s: Array) -> Array:
    """s (K, 4), moved along the axes of the cones where it is not inside of all."""
    out = s.copy()
    most = float((_length(s[:, 1:]) - s[:, 0]).max())
    if most >= -1e-8 * max(1.0, float(np.abs(s).max())):
        out[:, 0] += 1.0 + most
    return out


def _determinant(s: Array) -> Array:
    tail = _length(s[:, 1:])
    return np.maximum((s[:, 0] - tail) * (s[:, 0] + tail), 1e-300)


def _scaling(s: Array, z: Array) -> tuple[Array, Array]:
    """(K, 4, 4) W with W z = W^-1 s, and W^-1."""
    a, b = _determinant(s), _determinant(z)
    s, z = s / np.sqrt(a)[:, None], z / np.sqrt(b)[:, None]
    w = s + SIGNS * z
    w /= np.sqrt(2 * (1 + (s * z).sum(axis=1)))[:, None]
    v = w.copy()
    v[:, 0] += 1.0
    v /= np.sqrt(2 * v[:, 0])[:, None]
    beta = (a / b) ** 0.25
    out = 2 * v[:, :, None] * v[:, None, :] - np.diag(SIGNS)
    return beta[:, None, None] * out, SIGNS[:, None] * SIGNS * out / beta[:, None, None]


def _product(a: Array, b: Array) -> Array:
    """(K, 4) of the cones' algebra."""
    out = a[:, :1] * b + b[:, :1] * a
    out[:, 0] = (a * b).sum(axis=1)
    return out


def _divided(a: Array, b: Array) -> Array:
    """(K, 4) y with the product of a and y equal to b."""
    det = _determinant(a)
    y0 = (a * SIGNS * b).sum(axis=1) / det
    out: Array = (b - y0[:, None] * a) / a[:, :1]
    out[:, 0] = y0
    return out


def _longest(s: Array, d: Array) -> float:
    """How far from s along d (K, 4) everything stays inside."""
    a, b, c = (d * SIGNS * d).sum(axis=1), (s * SIGNS * d).sum(axis=1), _determinant(s)
    root = np.sqrt(np.maximum(b * b - a * c, 0.0)) - b
    meets = (b * b >= a * c) & (root > 0)
    return float((c[meets] / root[meets]).min(initial=np.inf))
