"""Linear complementarity as a baseline: friction pyramids, one quasi-static time step from rest.

D. E. Stewart, J. C. Trinkle, "An Implicit Time-Stepping Scheme for Rigid Body Dynamics with Inelastic Collisions and
Coulomb Friction", International Journal for Numerical Methods in Engineering 39, 1996, as the stability paper's section
II tells it: the cone becomes a pyramid, and friction is the combination of its edges that dissipates most. Of the
model, everything else is kept: contact springs (4), gearing (8), couplings. The step is so long that inertia hardly
counts:

    inertia y = forces
    c_n >= 0, c_n + d_n >= 0             t >= 0, f >= f_c
    beta >= 0, D' d_t + lambda >= 0      lambda >= 0, mu c_n >= sum of beta

with each pair complementary and y the motions of object and joints that locks and couplings leave. What inertia takes
up is what nothing balances: if that is next to nothing, the step says that the grasp holds. Nothing of it is proved.

The complementarity problem is solved by Lemke's method: C. E. Lemke, "Bimatrix Equilibrium Points and Mathematical
Programming", Management Science 11(7), 1965; R. W. Cottle, J.-S. Pang, R. E. Stone, "The Linear Complementarity
Problem", 1992, section 4.4. In floating point: the basis is factored anew at every pivot, and ties are kept apart by a
covering vector without equal entries.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space

from handfast.core.answer import Verdict
from handfast.core.arrays import Array, Indices
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers.baseline import BaselineState, with_torques
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.scaled_problem import ScaledPoint

BALANCED = 1e-3  # of the force scale: what may stay unbalanced in a grasp that holds
SMALL_PIVOT = 1e-11  # relative: pivots below it are none
MISSED = 1e-10  # by how much a variable may be negative at the end, beside q; it is then taken as 0
STARTS = 5  # covering vectors: where rounding ends the path from one, another may lead through


def pyramid_step(
    grasp: Grasp, wrench: object, *, edges: int = 8, turn: float = 0.0, inertia: float = 1e-7, seed: int | None = None
) -> BaselineState:
    """One step under a load (6,) [N, N m], or (3,), a force.

    Args:
        edges: of every pyramid, an even number; they end on the friction circle.
        turn: [rad] of the first edge from the contact's first tangent.
        inertia: (scaled) mass over the step squared, beside contact springs of 1.
        seed: of a random covering vector for Lemke's method, which may find another solution.

    Raises:
        InputError: as `check`; fewer than four edges, or an odd number; an inertia that is not positive.
    """
    if edges < 4 or edges % 2:
        raise InputError(f"is {edges}; an even number, 4 or more, is needed", field="edges")
    if not inertia > 0:
        raise InputError(f"is {inertia:g}; a positive number is needed", field="inertia")
    grasp.refuse_laws("the time step")
    grasp.refuse_soft_fingers("the time step")
    p = scaled_problem.build(grasp, scaled_problem.as_wrench(wrench))
    m, l, _, _ = p.sizes
    fixed = np.vstack([p.R[~p.moves], p.A])
    free = null_space(fixed) if len(fixed) and l else np.eye(l)
    Q = np.vstack([np.zeros((6, free.shape[1])), free])
    B = np.hstack([np.eye(6 + l)[:, :6], Q])  # (r, q) = B y
    K = B.T @ np.vstack([p.G, -p.J.T])  # d = K' y
    L = B.T @ np.vstack([np.zeros((6, int(p.moves.sum()))), p.R[p.moves].T])
    angle = turn + 2 * np.pi * np.arange(edges) / edges
    N, D = K[:, 0::3], np.hstack([K[:, 3 * i + 1 : 3 * i + 3] @ [np.cos(angle), np.sin(angle)] for i in range(m)])
    start = B.T @ np.r_[p.w0, p.R[p.moves].T @ p.f_c[p.moves]]

    sums = np.kron(np.eye(m), np.ones((1, edges)))  # (m, m edges)
    U = np.hstack([N, D, np.zeros((len(start), m)), L])
    M = U.T @ U  # every row times the inertia, and lambda counted in units of it: entries near one
    n, b = m, m * edges
    M[:n, :n] += inertia * np.eye(m)
    M[n : n + b, n + b : n + b + m] += sums.T
    M[n + b : n + b + m, :n] += np.diag(p.mu)
    M[n + b : n + b + m, n : n + b] -= sums
    q = U.T @ start
    cover = None if seed is None else np.random.default_rng(seed).uniform(0.1, 2.0, len(q)) ** 2
    z = lemke(M, q, cover=cover)
    if z is None:
        return BaselineState.of(p, Verdict.UNDECIDED, None, np.inf, 1)
    y = (start + U @ z) / inertia
    motion = B @ y
    c = np.zeros((m, 3))
    c[:, 0] = z[:m]
    c[:, 1:] = z[m : m + b].reshape(m, edges) @ np.column_stack([np.cos(angle), np.sin(angle)])
    point = with_torques(p, ScaledPoint(motion[:6], motion[6:], c.ravel(), np.zeros(len(p.R)), np.zeros(len(p.A))))
    left = float(np.linalg.norm(inertia * y))
    verdict = Verdict.HOLDS if left <= BALANCED else Verdict.SLIPS
    return BaselineState.of(p, verdict, point, left, 1)


def lemke(M: Array, q: Array, *, pivots: int = 2000, cover: Array | None = None) -> Array | None:
    """A solution z (n,) of w = M z + q, w >= 0, z >= 0, w . z = 0, for M (n, n) and q (n,).

    None if the method ends on rays, or after so many pivots each time.

    cover: (n,) > 0, the covering vector; where there are several solutions, it decides which one is found.
    """
    if (q >= 0).all():
        return np.zeros(len(q))
    if cover is not None:
        return _from(M, q, cover, pivots)
    for start in range(STARTS):
        cover = 1.0 + np.linspace(0.0, 0.5, len(q)) * np.cos((1.0 + start) * np.arange(len(q)))
        z = _from(M, q, cover, pivots)
        if z is not None:
            return z
    return None


def _from(M: Array, q: Array, cover: Array, pivots: int) -> Array | None:
    """The end of the path that begins with a covering vector (n,) > 0."""
    n = len(q)
    columns = np.hstack([np.eye(n), -M, -cover[:, None]])  # of w, z, and the covering variable z0
    basis = np.arange(n)
    leave = int(np.argmin(q / cover))
    enter = 2 * n
    for _ in range(pivots):
        gone, basis[leave] = int(basis[leave]), enter
        if gone == 2 * n:
            return _solution(columns, basis, q, n)
        enter = gone + n if gone < n else gone - n  # its complement comes in
        B = columns[:, basis]
        try:
            both = np.linalg.solve(B, np.column_stack([q, columns[:, enter]]))
        except np.linalg.LinAlgError:
            return None
        x, step = np.maximum(both[:, 0], 0.0), both[:, 1]
        falls = step > SMALL_PIVOT * np.abs(step).max()
        if not falls.any():
            return None
        ratio = np.where(falls, x / np.where(falls, step, 1.0), np.inf)
        near = np.flatnonzero(ratio <= ratio.min() * (1 + 1e-12) + 1e-300)
        z0 = near[basis[near] == 2 * n]  # ends as soon as it can
        leave = int(z0[0]) if len(z0) else int(near[np.argmax(step[near])])
    return None


def _solution(columns: Array, basis: Indices, q: Array, n: int) -> Array | None:
    """z of the final basis; None if it misses the problem by more than rounding."""
    try:
        x = np.linalg.solve(columns[:, basis], q)
    except np.linalg.LinAlgError:
        return None
    all_of = np.zeros(2 * n + 1)
    all_of[basis] = x
    return np.maximum(all_of[n : 2 * n], 0.0) if x.min() > -MISSED * float(np.abs(q).max()) else None
