"""The earlier scheme of the stability paper's authors as a baseline: no dissipation principle, corrected in turns.

M. Haas-Heger, G. Iyengar, M. Ciocarlie, "Passive Reaction Analysis for Grasp Stability", Transactions on Automation
Science and Engineering 15(3), 2018, reference 18 of the stability paper, as far as that paper's section II tells it:
contacts that may break make each program a mixed-integer one, friction lies anywhere in a pyramid, whichever way the
contact slides, and turns of an iteration correct what that gets wrong. How they do is our reading: were the object free
to move, it would move so that friction helps; so it may move only along the wrench that was left unbalanced by the turn
before, from where that turn ended. Each turn makes the unbalanced wrench as small as it can:

    minimise |G c + w|_1    with r = r_before + s u, s >= 0, u the unbalanced wrench before,
                            c_n = max(0, -d_n), c_t in the pyramid, joints as in (8)

The first turn holds the object still, so that only fingers move. The grasp holds if nothing is left, slips if a turn
does not get nearer. Nothing of it is proved, and friction may push along the motion.
"""

from __future__ import annotations

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers import mixed_integer_solvers
from handfast.papers.baseline import BaselineState
from handfast.papers.mixed_integer import INF, MixedIntegerProgram, Solver, SolverStatus, Term
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.scaled_problem import ScaledPoint, ScaledProblem

BALANCED = 1e-5  # of the force scale: what may be left where the grasp holds
NEARER = 1e-3  # relative: what a turn has to take off what is left
MOTIONS = 1e4  # (scaled) of object and joints, as in Algorithm 1


def turn_scheme(
    grasp: Grasp, wrench: object, *, edges: int = 8, turns: int = 50, solver: Solver = "scip", timeout: float = INF
) -> BaselineState:
    """The verdict on a load (6,) [N, N m], or (3,), a force; UNDECIDED if the turns do not end, or a program fails.

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
        if left <= BALANCED:
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
    far = MOTIONS / max(float(np.abs(along).max()), 1e-12)
    s = int(P.variables(1, 0.0, far if along.any() else 0.0)[0])
    q, f, coupling = P.variables(l, -MOTIONS, MOTIONS), P.variables(a), P.variables(k)
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
