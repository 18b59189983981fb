"""A scaled problem with its linear equations eliminated: what the compiled search works on.

Motions (r, q) = M u, with M a basis of what couplings and locked actuators leave; forces y = y0 + Y v solve
(1) and (2), the latter against admissible motions of the joints only, so that locked actuators' forces and
coupling multipliers never appear. z = (u, v). All base values of `rows` are affine in z.

Motions are capped at `MOTION_CAP` force scales. Every base value is then bounded, and so is z: the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from holdfast.mechanism import Array, Indices, Mask
from holdfast.stability.engine import tree
from holdfast.stability.goal import Goal, Load, Point, load, motion_cap, search_end
from holdfast.stability.problem import Problem

HIGHEST = 1e5  # of lambda: a maximum smaller than 1e-5 of the force scale counts as none
STRONGEST = 1e3  # of commands that are sought, in (scaled) forces
PERTURBATION = 1e-7  # of the cost, against ties; nodes are closed by infeasibility only, which it does not touch
RANK = 1e-10
_NOISE = 1 + np.random.default_rng(0).random(1024)


def null_space(A: Array) -> Array:
    """(n, n - rank) orthonormal basis of the null space of A (k, n)."""
    if not len(A):
        return np.eye(A.shape[1])
    _, s, Vt = np.linalg.svd(A)
    return Vt[int((s > RANK * max(s[0], 1e-300)).sum()) :].T


@dataclass(frozen=True, eq=False)
class Reduced:
    """The arrays of a search.

    Attributes:
        p, goal, load: the question.
        active: (a',) the actuators that may move, in the order of the base values; driven: (a',) bool.
        M: (6 + l, nu) basis of the motions; Y: (ny, nv), y0: (ny,): forces y = y0 + Y v with
            y = (c, f of `kept` actuators, scalar, efforts).
        B: (nb, n), off: (nb,): base values B z + off; BT: B's transpose.
        lo, hi: (P,) bounds of the plain base values; names: what each of them bounds.
        cap: largest (scaled) motion.
        cost: (n,) objective over z, perturbed.
        objective: what is sought, a constant of `tree`.
        scale: [N m or N] per unit of the objective, for torques.
        solvable: can (1) and (2) be met at all?
    """

    p: Problem
    goal: Goal
    load: Load
    active: Indices
    kept: Indices
    driven: Mask
    M: Array
    Y: Array
    y0: Array
    B: Array
    BT: Array
    off: Array
    lo: Array
    hi: Array
    names: tuple[tuple[str, int], ...]
    cap: float
    cost: Array
    objective: int
    scale: float
    solvable: bool

    @cached_property
    def motions(self) -> int:
        """Plain values that are motions: 6 + l."""
        return len(self.M)

    def point(self, z: Array) -> Point:
        """The model's scaled unknowns."""
        p = self.p
        m, l, a, k = p.sizes
        nu = self.M.shape[1]
        x, y = self.M @ z[:nu], self.y0 + self.Y @ z[nu:]
        c = y[: 3 * m]
        f, coupling = np.zeros(a), np.zeros(k)
        f[self.kept] = y[3 * m : 3 * m + len(self.kept)]
        rest = np.setdiff1d(np.arange(a), self.kept)
        if len(rest) + k:
            columns = np.vstack([p.R[rest], p.A]).T
            out = np.linalg.lstsq(columns, p.J.T @ c - p.R.T @ f, rcond=1e-12)[0]
            f[rest], coupling = out[: len(rest)], out[len(rest) :]
        sigma = float(y[3 * m + len(self.kept)]) if self.objective else 0.0
        return Point(x[:6], x[6:], c, f, coupling, sigma)

    def z(self, x: Point) -> Array:
        """The reduced unknowns nearest to a point of the model."""
        y = np.r_[x.c, x.f[self.kept]]
        if self.objective:
            y = np.r_[y, x.sigma]
        y = np.r_[y, np.zeros(len(self.y0) - len(y))]
        return np.r_[self.M.T @ np.r_[x.r, x.q], self.Y.T @ (y - self.y0)]


def reduce(p: Problem, goal: Goal) -> Reduced:
    """Eliminate the linear equations of a question.

    Args:
        p: the scaled problem.
        goal: what is sought.
    """
    m, l, a, k = p.sizes
    drive, moves, load_ = p.driven, p.moves, load(p, goal)
    active = np.flatnonzero(moves)
    keep = moves | np.isfinite(p.f_max)
    kept = np.flatnonzero(keep)
    objective = {
        Goal.EXISTS: tree.ANY,
        Goal.SMALLEST_PRELOAD: tree.SCALAR,
        Goal.LARGEST: tree.SCALAR,
        Goal.SMALLEST_MAX_TORQUE: tree.LARGEST_EFFORT,
        Goal.SMALLEST_SUM_TORQUE: tree.SUM_OF_EFFORTS,
    }[goal]
    efforts = np.flatnonzero(drive) if objective == tree.SUM_OF_EFFORTS else np.zeros(0, int)
    lever = np.abs(p.command(np.ones(a)))  # N m or N per scaled actuator force
    scale = float(lever[drive].max()) if drive.any() else 1.0

    Q = null_space(np.vstack([p.A, p.R[~moves]])) if l else np.zeros((0, 0))
    M = np.zeros((6 + l, 6 + Q.shape[1]))
    M[:6, :6], M[6:, 6:] = np.eye(6), Q
    Z = null_space(np.vstack([p.A, p.R[~keep]])) if l else np.zeros((0, 0))

    C, F, S = 3 * m, 3 * m + len(kept), 3 * m + len(kept) + (objective > 0)
    ny = S + len(efforts)
    E, h = np.zeros((6 + Z.shape[1] + (len(efforts) > 0), ny)), np.zeros(6 + Z.shape[1] + (len(efforts) > 0))
    E[:6, :C], h[:6] = p.G, -load_.w_a  # (1)
    if objective == tree.SCALAR:
        E[:6, F] = load_.w_b
    E[6 : 6 + Z.shape[1], :C] = Z.T @ p.J.T  # (2)
    E[6 : 6 + Z.shape[1], C:F] = -Z.T @ p.R[kept].T
    if len(efforts):
        E[-1, F], E[-1, S:] = 1.0, -1.0
    U, sv, Vt = np.linalg.svd(E)
    rank = int((sv > RANK * sv[0]).sum())
    y0 = Vt[:rank].T @ ((U[:, :rank].T @ h) / sv[:rank])
    Y = Vt[rank:].T
    solvable = bool(np.abs(E @ y0 - h).max() < 1e-9)

    nu, n = M.shape[1], M.shape[1] + Y.shape[1]
    cap = motion_cap(p, goal)
    plain: list[tuple[str, int, float, float]] = []
    if objective == tree.SCALAR and goal is Goal.SMALLEST_PRELOAD:
        plain.append(("scalar", 0, 1.0 / search_end(p), HIGHEST))
    elif goal is Goal.LARGEST:
        plain.append(("scalar", 0, -search_end(p), 0.0))
    elif objective:
        plain.append(("scalar", 0, 0.0, STRONGEST))
    plain += [("motion", i, -cap, cap) for i in range(6 + l)]
    if np.isfinite(p.cn_max):
        plain += [("normal", i, 0.0, p.cn_max) for i in range(m)]
    plain += [("force", int(i), -p.f_max[i], p.f_max[i]) for i in kept if np.isfinite(p.f_max[i])]
    plain += [("effort", int(i), 0.0, STRONGEST) for i in efforts]

    a_ = len(active)
    nb = 6 * m + 3 * a_ + len(plain)
    B, off = np.zeros((nb, n)), np.zeros(nb)
    contact = B[: 6 * m].reshape(m, 6, n)
    contact[:, :3, nu:] = Y[:C].reshape(m, 3, -1)
    off[: 6 * m].reshape(m, 6)[:, :3] = y0[:C].reshape(m, 3)
    contact[:, 3:, :nu] = (np.hstack([p.G.T, -p.J]) @ M).reshape(m, 3, nu)
    place = {int(i): C + n_ for n_, i in enumerate(kept)}
    for j, i in enumerate(active):
        k0 = 6 * m + 3 * j
        B[k0, 6:nu] = p.R[i] @ Q
        B[k0 + 1, nu:], off[k0 + 1] = Y[place[int(i)]], y0[place[int(i)]]
        if drive[i]:
            e = S + int(np.searchsorted(efforts, i)) if len(efforts) else F
            share = lever[i] / scale
            B[k0 + 2, nu:] = Y[e] - share * Y[place[int(i)]]
            off[k0 + 2] = y0[e] - share * y0[place[int(i)]]
        else:
            off[k0 + 1] -= load_.f_a[i]
            if objective:
                B[k0 + 1, nu:] -= load_.f_b[i] * Y[F]
                off[k0 + 1] -= load_.f_b[i] * y0[F]
    sign = -1.0 if goal is Goal.LARGEST else 1.0
    for j, (kind, i, _, _) in enumerate(plain):
        k0 = 6 * m + 3 * a_ + j
        if kind == "motion":
            B[k0, :nu] = M[i]
            continue
        at = {"scalar": F, "normal": 3 * i, "force": place.get(i, 0), "effort": S + int(np.searchsorted(efforts, i))}
        s = sign if kind == "scalar" else 1.0
        B[k0, nu:], off[k0] = s * Y[at[kind]], s * y0[at[kind]]

    lo, hi = np.array([b[2] for b in plain]), np.array([b[3] for b in plain])
    cost = B[6 * m + 3 * a_].copy() if objective else np.zeros(n)
    cost += np.where(cost >= 0, 1.0, -1.0) * PERTURBATION * _NOISE[:n]
    return Reduced(
        p=p,
        goal=goal,
        load=load_,
        active=active,
        kept=kept,
        driven=drive[active],
        M=M,
        Y=Y,
        y0=y0,
        B=B,
        BT=np.ascontiguousarray(B.T),
        off=off,
        lo=lo,
        hi=hi,
        names=tuple((b[0], b[1]) for b in plain),
        cap=cap,
        cost=cost,
        objective=objective,
        scale=scale,
        solvable=solvable,
    )


def box(r: Reduced, highest: float) -> Array:
    """(n,) bounds of |z| while the objective is at most `highest` (of plain value 0).

    From the cap on motions: c_n <= |d_n|, and by energy sum c_n^2 <= w . r + f_c . t where friction obeys the
    dissipation principle.
    """
    p = r.p
    d = (np.abs(np.hstack([p.G.T, p.J])).sum(axis=1) * r.cap).reshape(-1, 3)
    cn = np.minimum(d[:, 0], p.cn_max)
    top = max(abs(float(r.lo[0])), abs(min(highest, float(r.hi[0])))) if r.objective else 0.0
    if p.mdp:
        sought = top * r.scale / np.abs(p.command(np.ones(len(p.R))))
        command = np.where(p.driven, sought, r.load.f_a + top * r.load.f_b)
        force = np.abs(r.load.w_a) + top * np.abs(r.load.w_b)
        cn = np.minimum(cn, np.sqrt((force.sum() + command @ np.abs(p.R).sum(axis=1)) * r.cap))
    c = np.column_stack([cn, p.mu * cn, p.mu * cn]).reshape(-1)
    columns = np.vstack([p.R, p.A]).T
    f = (np.abs(np.linalg.pinv(columns)) @ (np.abs(p.J.T) @ c))[: len(p.R)] if len(p.R) else np.zeros(0)
    y = np.r_[c, np.minimum(f, p.f_max)[r.kept]]
    y = np.r_[y, np.full(len(r.y0) - len(y), top)]
    return np.r_[np.abs(r.M).T @ np.full(len(r.M), r.cap), np.abs(r.Y).T @ (y + np.abs(r.y0))]
