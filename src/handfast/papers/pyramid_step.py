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
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space

from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers.baseline import BaselineState, with_torques
from handfast.papers.lemke import lemke
from handfast.stability import scaled_problem
from handfast.stability.scaled_problem import ScaledPoint

BALANCED = 1e-3  # of the force scale: what may stay unbalanced in a grasp that holds


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
