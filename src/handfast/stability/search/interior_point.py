"""Small convex programs over second-order cones, by an interior-point method: it ends inside wherever there is room.

Source: L. Vandenberghe, The CVXOPT linear and quadratic cone program solvers, 2010, sections 4, 5 and 7: a primal-dual
path with Nesterov-Todd scaling and Mehrotra's correction. Every cone has four numbers here, the first at least the
length of the others; of shorter ones the last are zero, of an inequality all but the first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Mask

CONE_SIZE = 4  # numbers of a cone
INTERIOR_POINT_STEPS = 60
CENTRED = 0.1  # relative: how near the path its end is
STEP_FRACTION = 0.99  # of the longest step
# relative: what x may miss of being inside, and multipliers of the smallest
FEASIBILITY_TOLERANCE, OPTIMALITY_TOLERANCE = 1e-11, 1e-8
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

    @classmethod
    def at_least(cls, rows: Array, offset: Array) -> Cones:
        """offset (K,) + rows (K, n) x >= 0."""
        out = cls(np.zeros((len(rows), CONE_SIZE, rows.shape[1])), np.zeros((len(rows), CONE_SIZE)))
        out.rows[:, 0], out.offset[:, 0] = rows, offset
        return out

    def with_(self, other: Cones) -> Cones:
        """Those of both."""
        return Cones(np.concatenate([self.rows, other.rows]), np.concatenate([self.offset, other.offset]))

    def felt(self) -> Cones:
        """Those of which x decides anything."""
        return Cones(self.rows[self._are_felt], self.offset[self._are_felt])

    def unfelt(self) -> Cones:
        """The others."""
        return Cones(self.rows[~self._are_felt], self.offset[~self._are_felt])

    @property
    def _are_felt(self) -> Mask:
        return np.asarray((np.abs(self.rows) > UNFELT).any(axis=(1, 2)), dtype=bool)

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
    if not len(cones.offset):
        return _lowest(quadratic, cost)
    G = -cones.rows.reshape(-1, len(cost))
    with np.errstate(all="ignore"):  # numbers that overflow end the path
        return _followed(G, cones.offset, cost, quadratic, end)


def _followed(G: Array, h: Array, cost: Array, quadratic: Array, end: float) -> Array | None:
    """The end of the path to the smallest x^T quadratic x / 2 + cost @ x with h (K, 4) - G x in the cones."""
    K = len(h)
    unit = np.zeros((K, CONE_SIZE))
    unit[:, 0] = 1.0
    x: Array = _lowest(quadratic + G.T @ G, cost - G.T @ h.ravel())
    s = h - (G @ x).reshape(K, CONE_SIZE)
    z = -s
    s, z = _moved_inside(s), _moved_inside(z)
    scale = 1.0 + float(np.abs(h).max()), 1.0 + float(np.abs(cost).max())
    for _ in range(INTERIOR_POINT_STEPS):
        mu = float((s * z).sum()) / K
        missing_x = quadratic @ x + cost + G.T @ z.ravel()
        missing_s = s + (G @ x).reshape(K, CONE_SIZE) - h
        small = (
            np.abs(missing_s).max() <= FEASIBILITY_TOLERANCE * scale[0]
            and np.abs(missing_x).max() <= OPTIMALITY_TOLERANCE * scale[1]
        )
        if small and (np.abs((s * z).sum(axis=1) - end) <= CENTRED * end).all():
            return x
        if not mu > 0:
            return None
        W, inverse = _scaling(s, z)
        newton = _Newton.of(G, quadratic, _times(W, z), inverse, missing_x, missing_s)
        if newton is None:
            return None
        scaled = newton.scaled
        square = _product(scaled, scaled)
        _, wdz, wds = newton.step(square)
        a = min(1.0, _longest(scaled, wds), _longest(scaled, wdz))
        centre = max((1 - a) ** 3 * mu, end)
        correction = max(1 - centre / mu, 0.0) * _product(wds, wdz)  # none of a step that goes to the centre alone
        dx, wdz, wds = newton.step(square + correction - centre * unit)
        a = min(1.0, STEP_FRACTION * min(_longest(scaled, wds), _longest(scaled, wdz)))
        x = x + a * dx
        s, z = s + a * _times(W, wds), z + a * _times(inverse, wdz)
        if not (np.isfinite(x).all() and np.isfinite(s).all() and np.isfinite(z).all()):
            return None
    return None


def _lowest(quadratic: Array, cost: Array) -> Array:
    """(n,) where x^T quadratic x / 2 + cost @ x is smallest, without any cones."""
    return np.asarray(np.linalg.lstsq(quadratic, -cost, rcond=None)[0], dtype=float)


@dataclass(frozen=True, eq=False)
class _Newton:
    """The equations of a step, scaled.

    Attributes:
        scaled: (K, 4) W z = W^-1 s. inverse: (K, 4, 4) W^-1. GW: (4 K, n) W^-1 G.
        factor: (n, n) inverse of quadratic + GW^T GW.
        missing_x, missing_s: (n,), (K, 4) what the equations miss.
    """

    scaled: Array
    inverse: Array
    GW: Array
    factor: Array
    missing_x: Array
    missing_s: Array

    @classmethod
    def of(
        cls, G: Array, quadratic: Array, scaled: Array, inverse: Array, missing_x: Array, missing_s: Array
    ) -> _Newton | None:
        """None where the equations have no unique solution."""
        GW = (inverse @ G.reshape(*scaled.shape, -1)).reshape(G.shape)
        try:
            factor = np.asarray(np.linalg.inv(quadratic + GW.T @ GW), dtype=float)
        except np.linalg.LinAlgError:
            return None
        return cls(scaled, inverse, GW, factor, missing_x, missing_s)

    def step(self, right: Array) -> tuple[Array, Array, Array]:
        """dx (n,), W dz and W^-1 ds (K, 4) with the product of `scaled` and their sum equal to -right (K, 4)."""
        y = _divided(self.scaled, right)
        known = _times(self.inverse, self.missing_s) - y
        dx = self.factor @ (-self.missing_x - self.GW.T @ known.ravel())
        wdz = (self.GW @ dx).reshape(known.shape) + known
        return dx, wdz, -y - wdz


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
    """(K,) the square of the first number less those of the others, where that is positive."""
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
    beta: Array = (a / b) ** 0.25
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
    root = np.sqrt(np.maximum(b * b - a * c, 0.0)) - b  # what is under the root is never negative, but for rounding
    meets = root > 0
    return float((c[meets] / root[meets]).min(initial=np.inf))
