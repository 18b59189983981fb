"""Constants of a problem for the prover: bounds of its regions' derivatives, and cones that hold the object's axes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from handfast.core.arrays import Array
from handfast.model.region import Bezier, Cap, Region, differences, restrict
from handfast.synthesis.task_problem import TaskProblem

CELLS = 8  # each way, of a region: each has constants of its own
UP = 1.0 + 1e-9  # over the rounding of the constants below


def derivative_bounds(problem: TaskProblem) -> Array:
    """(b, 2, CELLS, CELLS, 10) constants of the object's and the hand's regions, see `taylor.worst`; units."""
    out = np.zeros((len(problem.task.contact_pairs), 2, CELLS, CELLS, 10))
    for k, pair in enumerate(problem.task.contact_pairs):
        radius = pair.hand.radius if isinstance(pair.hand, Cap) else 0.0
        for i, region in enumerate((pair.object, pair.hand)):
            if isinstance(region, Bezier) or i == 0:
                surface, normal = bounds(region)
                outward = radius * normal if i == 0 else 0.0
                out[k, i] = np.concatenate([(surface + outward) / problem.unit, normal], axis=2) * UP
                if isinstance(region, Cap):  # its parameters are no fractions; the constants hold everywhere
                    out[k, i, 0, 1] = np.nan
    return out


def bounds(region: Region) -> tuple[Array, Array]:
    """Bounds (CELLS, CELLS, 5) in each cell of |p_s|, |p_t|, |p_ss|, |p_st|, |p_tt| [m], and of the unit normal's.

    From Bernstein coefficients: a polynomial lies in the hull of them. With n the normal, not normalised,
    and f' and f'' its derivatives, those of n / |n| are at most |f'| / |n| and |f''| / |n| + (2 / sqrt 3)
    |f'|^2 / |n|^2 (mixed ones alike).
    """
    shape = (CELLS, CELLS, 5)
    if isinstance(region, Cap):
        return np.full(shape, region.radius), np.ones(shape)
    surface, normal = np.zeros(shape), np.zeros(shape)
    cuts = list(pairwise(np.linspace(0, 1, CELLS + 1).tolist()))
    curve = 2 / np.sqrt(3)
    for i, j in np.ndindex(CELLS, CELLS):
        points, n = (restrict(p, cuts[i], cuts[j]) for p in (region.points, region.normal_points))
        surface[i, j], least = _largest(points), _least(n)
        f = _largest(n) / least
        normal[i, j] = f + curve * np.array([0, 0, f[0] ** 2, f[0] * f[1], f[1] ** 2])
    return surface, normal


def _largest(points: Array) -> Array:
    """(5,) bounds of a polynomial's derivatives over a cell, in the parameters of the whole."""
    orders = ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    return np.array([CELLS ** sum(o) * np.linalg.norm(differences(points, *o), axis=2).max() for o in orders])


def _least(n: Array, depth: int = 0) -> float:
    """A positive lower bound of |n| over a patch of normals (its regularity is known)."""
    along = n.reshape(-1, 3).mean(axis=0)
    along /= np.linalg.norm(along)
    value = float((n @ along).min())
    if value > 0 or depth == 8:
        return max(value, 1e-30)
    halves = ((0.0, 0.5), (0.5, 1.0))
    return min(_least(restrict(n, u, v), depth + 1) for u in halves for v in halves)


def cones(problem: TaskProblem) -> Array:
    """(m, 5) bounds of the object's axes: index of the axis, unit direction in the palm frame, angle from it."""
    rows = []
    for k, box in enumerate(problem.task.pose.axes):
        tries = [*np.eye(3), *-np.eye(3)]
        middle = box.mean(axis=1)
        if np.linalg.norm(middle) > 1e-6:
            tries.append(middle / np.linalg.norm(middle))
        for c in tries:
            # no vector within the bounds has a smaller component along c
            least = float(np.minimum(c * box[:, 0], c * box[:, 1]).sum())
            if least > -1:
                rows.append([k, *c, np.arccos(min(least, 1.0)) + 1e-9])
    return np.array(rows).reshape(-1, 5)
