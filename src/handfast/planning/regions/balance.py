"""Do forces at some points of an object balance? The margin by which they do, for choosing where to touch."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import normal_frame

SIDES = 8  # of the polygon inside each friction circle
LEAST = 0.08  # of the squeezing force: a point that would carry less is left out of the first look


def imbalance(points: Array, normals: Array) -> Array:
    """(m,) how far k pushes along the inward normals are from balance, for m tuples; inf if one would have to pull.

    The pushes w sum to 1 and minimise |sum w n|^2 + |sum w (p - c) x n|^2 / s^2 about the middle c of the points,
    with s their mean distance from it: roughly the friction coefficient that makes up for the rest.

    Args:
        points: (m, k, 3) [m].
        normals: (m, k, 3) inward unit normals.
    """
    k = points.shape[1]
    arms = points - points.mean(axis=1, keepdims=True)
    size = np.maximum(np.linalg.norm(arms, axis=2).mean(axis=1), 1e-9)
    wrench = np.concatenate([normals, np.cross(arms, normals) / size[:, None, None]], axis=2)
    gram = wrench @ wrench.swapaxes(1, 2) + 1e-6 * np.eye(k)
    w = np.linalg.solve(gram, np.ones((*gram.shape[:2], 1)))[..., 0]
    w /= w.sum(axis=1, keepdims=True)
    rest = np.linalg.norm(np.einsum("mk,mkj->mj", w, wrench), axis=1)
    return np.where((w > LEAST).all(axis=1), rest, np.inf)


def margin(points: Array, normals: Array, friction: float) -> float:
    """How far within their friction cones balanced forces can be, relative to the friction: up to 1, below 0 if none.

    The largest t with sum c = 0, sum p x c = 0, sum c_n = 1 and |c_t| <= mu c_n - t at each of the k points, times
    k / mu. The circles are replaced by polygons inside them, so it is never too large. Positive means equilibrium with
    every contact strictly within its cone: force closure for three contacts that are not on a line and more (Nguyen
    1988), and for two up to turning about the line between them.

    Args:
        points: (k, 3) [m].
        normals: (k, 3) inward unit normals.
        friction: coefficient, positive.
    """
    from scipy.optimize import linprog

    k = len(points)
    arms = points - points.mean(axis=0)
    size = max(float(np.linalg.norm(arms, axis=1).mean()), 1e-9)
    balance, inside = np.zeros((7, 3 * k + 1)), np.zeros((SIDES * k, 3 * k + 1))
    around = np.arange(SIDES) * 2 * np.pi / SIDES
    shrunk = np.cos(np.pi / SIDES)
    for i, n in enumerate(normals):
        axes = np.array([*normal_frame(n).T])
        own = slice(3 * i, 3 * i + 3)
        balance[:3, own] = axes.T
        balance[3:6, own] = np.cross(arms[i] / size, axes).T
        balance[6, 3 * i] = 1.0
        rows = slice(SIDES * i, SIDES * (i + 1))
        inside[rows, own] = np.column_stack([np.full(SIDES, -friction * shrunk), np.cos(around), np.sin(around)])
        inside[rows, -1] = shrunk
    target = np.zeros(7)
    target[6] = 1.0
    cost = np.zeros(3 * k + 1)
    cost[-1] = -1.0
    bounds = [(0.0, None), (None, None), (None, None)] * k + [(-1.0, None)]
    found = linprog(cost, A_ub=inside, b_ub=np.zeros(len(inside)), A_eq=balance, b_eq=target, bounds=bounds)
    return float(-found.fun * k / friction) if found.status == 0 else -1.0
