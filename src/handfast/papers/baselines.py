"""Older methods as baselines, held against the model: the authors' earlier scheme, and friction pyramids.

Both judge one load; nothing of it is proved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from handfast.core.answer import Verdict
from handfast.core.arrays import Array, Indices
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers import mixed_integer_solvers
from handfast.papers.friction_relaxation import MOTION_BOUND
from handfast.papers.mixed_integer import INF, MixedIntegerProgram, Solver, SolverStatus, Term
from handfast.proofs.states import State
from handfast.stability.problem import judge, scaled_problem
from handfast.stability.problem.scaled_problem import ScaledPoint, ScaledProblem

MIN_SLIDING = 1e-6  # of the force scale: motions and forces above have a direction
BALANCE_RESIDUAL = 1e-5  # of the force scale: what may be left where the grasp holds
NEARER = 1e-3  # relative: what a turn has to take off what is left
STEP_BALANCED = 1e-3  # of the force scale: what may stay unbalanced in a grasp that holds
SMALL_PIVOT = 1e-11  # relative: pivots below it are none
NEGATIVE_TOLERANCE = 1e-10  # by how much a variable may be negative at the end, beside q; it is then taken as 0
COVERING_STARTS = 5  # covering vectors: where rounding ends the path from one, another may lead through


@dataclass(frozen=True, eq=False)
class BaselineState:
    """What a baseline says of a grasp under a load. Never proved.

    Attributes:
        verdict: HOLDS or SLIPS by the method's own measure; UNDECIDED where it ends without either.
        state: its motions and forces; None if it found none.
        unbalanced: the part of the load that its forces leave over, relative to the force scale.
        turns: programs that were solved.
        residuals: how far the state is from the model; None without one.
        friction_errors: (m,) [rad] angle between friction and the direction against the slip; NaN where a contact
            does not slide or carries nothing.
    """

    verdict: Verdict
    state: State | None
    unbalanced: float
    turns: int
    residuals: judge.Residuals | None
    friction_errors: Array

    @classmethod
    def of(
        cls, p: ScaledProblem, verdict: Verdict, point: ScaledPoint | None, unbalanced: float, turns: int
    ) -> BaselineState:
        """With the errors of a scaled point, if there is one."""
        errors = np.full(len(p.mu), np.nan)
        if point is None:
            return cls(verdict, None, unbalanced, turns, None, errors)
        state = p.unscale(point)
        c, d = point.c.reshape(-1, 3), p.relative_motion(point.r, point.q)
        for i, (force, motion) in enumerate(zip(c[:, 1:], d[:, 1:], strict=True)):
            if np.hypot(*force) > MIN_SLIDING and np.hypot(*motion) > MIN_SLIDING:
                a, b = force, -motion
                errors[i] = abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
        return cls(verdict, state, unbalanced, turns, judge.residuals(p.grasp, p.wrench, state), errors)


def with_torques(p: ScaledProblem, x: ScaledPoint) -> ScaledPoint:
    """The point with the actuator forces and multipliers that carry its joint torques best."""
    if not len(p.R) + len(p.A):
        return x
    found = np.linalg.lstsq(np.vstack([p.R, p.A]).T, p.J.T @ x.c, rcond=None)[0]
    carried = np.asarray(found, dtype=np.float64)
    return ScaledPoint(x.r, x.q, x.c, carried[: len(p.R)], carried[len(p.R) :])


# --- the earlier scheme ---


def turn_scheme(
    grasp: Grasp, wrench: object, *, edges: int = 8, turns: int = 50, solver: Solver = "scip", timeout: float = INF
) -> BaselineState:
    """The verdict on a load (6,) [N, N m], or (3,), a force; UNDECIDED if the turns do not end, or a program fails.

    M. Haas-Heger, G. Iyengar, M. Ciocarlie, "Passive Reaction Analysis for Grasp Stability", Transactions on Automation
    Science and Engineering 15(3), 2018, reference 18 of the stability paper, as far as that paper's section II tells
    it: contacts that may break make each program a mixed-integer one, friction lies anywhere in a pyramid, whichever
    way the contact slides, and turns of an iteration correct what that gets wrong. How they do is our reading: were the
    object free to move, it would move so that friction helps; so it may move only along the wrench that was left
    unbalanced by the turn before, from where that turn ended. Each turn makes the unbalanced wrench as small as it can:

        minimise |G c + w|_1    with r = r_before + s u, s >= 0, u the unbalanced wrench before,
                                c_n = max(0, -d_n), c_t in the pyramid, joints as in (8)

    The first turn holds the object still, so that only fingers move. The grasp holds if nothing is left, slips if a
    turn does not get nearer. Friction may push along the motion.

    Args:
        edges: of every pyramid; they end on the friction circle.
        turns: at most.
        timeout: [s] for each program.

    Raises:
        InputError: as `check`; no turn, or fewer than three edges; a solver that is not installed.
    """
    if edges < 3 or turns < 1:
        field, value, least = ("edges", edges, 3) if edges < 3 else ("turns", turns, 1)
        raise InputError(f"is {value}; {least} or more are needed", field=field)
    grasp.refuse_laws("the iterative scheme")
    grasp.refuse_soft_fingers("the iterative scheme")
    p = scaled_problem.build(grasp, scaled_problem.as_wrench(wrench))
    r, along, left = np.zeros(6), np.zeros(6), INF
    point: ScaledPoint | None = None
    for turn in range(1, turns + 1):
        found = _nearest(p, r, along, edges, solver, timeout)
        if found is None:
            return BaselineState.of(p, Verdict.UNDECIDED, point, left, turn)
        before, (point, along) = left, found
        r, left = point.r, float(np.abs(along).sum())
        if left <= BALANCE_RESIDUAL:
            return BaselineState.of(p, Verdict.HOLDS, point, left, turn)
        if turn > 1 and left > (1 - NEARER) * before:
            return BaselineState.of(p, Verdict.SLIPS, point, left, turn)
    return BaselineState.of(p, Verdict.UNDECIDED, point, left, turns)


def _nearest(
    p: ScaledProblem, r: Array, along: Array, edges: int, solver: Solver, timeout: float
) -> tuple[ScaledPoint, Array] | None:
    """The point of one turn and the wrench (6,) that it leaves; None if its program is not solved."""
    m, l, a, k = p.sizes
    angle = 2 * np.pi * np.arange(edges) / edges
    D = np.vstack([np.cos(angle), np.sin(angle)])
    P = MixedIntegerProgram()
    far = MOTION_BOUND / max(float(np.abs(along).max()), 1e-12)
    s = int(P.variables(1, 0.0, far if along.any() else 0.0)[0])
    q, f, coupling = P.variables(l, -MOTION_BOUND, MOTION_BOUND), P.variables(a), P.variables(k)
    cn, beta = P.variables(m, 0.0), P.variables(m * edges, 0.0).reshape(m, edges)
    over, under = P.variables(6, 0.0), P.variables(6, 0.0)
    P.cost = {int(i): 1.0 for i in (*over, *under)}

    def forces(columns: Array) -> list[Term]:
        """columns (3m,) times the contact forces."""
        tangents = [(beta[i], columns[3 * i + 1 : 3 * i + 3] @ D) for i in range(m)]
        return [(cn, columns[0::3]), *tangents]

    for row in range(6):
        P.row([*forces(p.G[row]), (over[row], -1.0), (under[row], 1.0)], -p.w0[row], -p.w0[row])
    for j in range(l):
        P.row([*forces(p.J[:, j]), (f, -p.R[:, j]), (coupling, -p.A[:, j])], 0.0, 0.0)
    for row_of in p.A:
        P.row([(q, row_of)], 0.0, 0.0)
    for i in range(m):
        N = p.G[:, 3 * i]
        gap = int(P.variables(1, 0.0)[0])
        here = float(N @ r)
        P.row([(cn[i], 1.0), (gap, -1.0), (s, N @ along), (q, -p.J[3 * i])], -here, -here)
        P.sos1.append([int(cn[i]), gap])
        P.row([(cn[i], p.mu[i]), (beta[i], -1.0)], 0.0, INF)
    for i in range(a):
        if not p.moves[i]:
            P.row([(q, p.R[i])], 0.0, 0.0)
            continue
        t, slack = (int(v) for v in P.variables(2, 0.0))
        P.row([(q, p.R[i]), (t, -1.0)], 0.0, 0.0)
        P.row([(f[i], 1.0), (slack, -1.0)], p.f_c[i], p.f_c[i])
        P.sos1.append([t, slack])
    found = mixed_integer_solvers.solve(P, solver, timeout=timeout)
    if found.x is None or found.status is not SolverStatus.OPTIMAL:
        return None
    x = found.x
    c = np.column_stack([x[cn], x[beta] @ D.T])
    point = ScaledPoint(r + x[s] * along, x[q], c.ravel(), x[f], x[coupling])
    return point, x[over] - x[under]


# --- friction pyramids, by linear complementarity ---


def pyramid_step(
    grasp: Grasp, wrench: object, *, edges: int = 8, turn: float = 0.0, inertia: float = 1e-7, seed: int | None = None
) -> BaselineState:
    """One step under a load (6,) [N, N m], or (3,), a force.

    D. E. Stewart, J. C. Trinkle, "An Implicit Time-Stepping Scheme for Rigid Body Dynamics with Inelastic Collisions
    and Coulomb Friction", International Journal for Numerical Methods in Engineering 39, 1996, as the stability paper's
    section II tells it: the cone becomes a pyramid, and friction is the combination of its edges that dissipates most.
    Of the model, everything else is kept: contact springs (4), gearing (8), couplings. The step is so long that inertia
    hardly counts:

        inertia y = forces
        c_n >= 0, c_n + d_n >= 0             t >= 0, f >= f_c
        beta >= 0, D' d_t + lambda >= 0      lambda >= 0, mu c_n >= sum of beta

    with each pair complementary and y the motions of object and joints that locks and couplings leave. What inertia
    takes up is what nothing balances: if that is next to nothing, the step says that the grasp holds.

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
    verdict = Verdict.HOLDS if left <= STEP_BALANCED else Verdict.SLIPS
    return BaselineState.of(p, verdict, point, left, 1)


def lemke(M: Array, q: Array, *, pivots: int = 2000, cover: Array | None = None) -> Array | None:
    """A solution z (n,) of w = M z + q, w >= 0, z >= 0, w . z = 0, for M (n, n) and q (n,).

    C. E. Lemke, "Bimatrix Equilibrium Points and Mathematical Programming", Management Science 11(7), 1965; R. W.
    Cottle, J.-S. Pang, R. E. Stone, "The Linear Complementarity Problem", 1992, section 4.4. In floating point: the
    basis is factored anew at every pivot, and ties are kept apart by a covering vector without equal entries.

    None if the method ends on rays, or after so many pivots each time.

    cover: (n,) > 0, the covering vector; where there are several solutions, it decides which one is found.
    """
    if (q >= 0).all():
        return np.zeros(len(q))
    if cover is not None:
        return _from(M, q, cover, pivots)
    for start in range(COVERING_STARTS):
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
    return np.maximum(all_of[n : 2 * n], 0.0) if x.min() > -NEGATIVE_TOLERANCE * float(np.abs(q).max()) else None
