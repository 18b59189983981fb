"""A scaled problem with its linear equations eliminated: what the compiled search works on.

Motions (r, q) = M u, with M a basis of what couplings and locked actuators leave; forces y = y0 + Y v solve
(1) and (2), the latter against admissible motions of the joints only, so that locked actuators' forces and
coupling multipliers never appear. z = (u, v). All base values of `rows` are affine in z.

Nothing bounds motions, and nothing but limits bounds forces. Programs begin at the corner of a box in z that is
larger than anything they have to find; no proof may cite it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.groups import table, whole_vectors
from handfast.stability.goal import STRONGEST, Goal, Load, Point, load, search_end
from handfast.stability.problem import Problem
from handfast.stability.search import arrays

FARTHER = 1e6  # times the usual end of magnitudes, where nothing is resisted up to there
HIGHEST = 1e4  # of lambda, unless it is to be endless: the balance of energy needs an end
PREFERENCE = 1e-6  # small contact forces among equals: their points are near exact states, and nodes close sooner
PERTURBATION = 1e-10  # against ties. Nodes are closed by infeasibility only, which neither touches
RANK = 1e-10
# (scaled) motions and forces of the box where programs begin: far enough for most, near enough for rounding. What is
# near for one grasp is far for another, so that a search whose programs break down begins again with the next.
BOXES = (1e4, 1e5), (1e5, 1e3), (1e6, 1e5), (1e4, 1e3), (1e5, 1e5)
_NOISE = 1 + np.random.default_rng(0).random(1024)


def null_space(A: Array) -> Array:
    """(n, n - rank) orthonormal basis of the null space of A (k, n)."""
    if not len(A):
        return np.eye(A.shape[1])
    used = A != 0
    if (used.sum(axis=1) == 1).all():  # it only picks columns
        return np.eye(A.shape[1])[:, ~used.any(axis=0)]
    _, s, Vt = np.linalg.svd(A)
    return Vt[int((s > RANK * max(s[0], 1e-300)).sum()) :].T


def pseudo_inverse(A: Array) -> Array:
    """(n, k) of A (k, n), by hand if each column has one entry in a row of its own: a motor per joint."""
    used = A != 0
    if (used.sum(axis=0) == 1).all() and (used.sum(axis=1) <= 1).all():
        out: Array = np.divide(1.0, A, out=np.zeros(A.shape), where=used).T
        return out
    return np.asarray(np.linalg.pinv(A, rcond=1e-12), dtype=float)


def padded(x: Array) -> Array:
    """With zeros behind each row, for whole vectors of the processor."""
    out = np.zeros((*x.shape[:-1], whole_vectors(x.shape[-1])))
    out[..., : x.shape[-1]] = x
    return out


@dataclass(frozen=True, eq=False)
class Reduced:
    """The arrays of a search.

    Attributes:
        p, goal, load: the question.
        active: (a',) the actuators that may move, in the order of the base values; driven: (a',) bool.
        M: (6 + l, nu) basis of the motions; Y: (ny, nv), y0: (ny,): forces y = y0 + Y v with
            y = (c, f of `kept` actuators, scalar, efforts).
        C, D: (., n) base values of `rows`, forces C z + off and motions D z; CT, DT: transposed, without the unknowns
            that are zero. These and off are filled with zeros up to whole vectors of the processor.
        lo, hi: (P,) bounds of the plain base values; names: what each of them bounds.
        box: (n,) where programs begin: |z| there.
        cap: largest (scaled) motion, inf without end; with one, z is within the box, which rays may cite.
        cost: (n,) objective over z, and what is preferred among equals.
        objective: what is sought, a constant of `arrays`.
        scale: [N m or N] per unit of the objective, for torques.
        solvable: can (1) and (2) be met at all?
        solve: (ny, e) pseudo-inverse of the equations; values, constants: base values over y. With them
            another disturbance of the same grasp is cheap, see `redirected`.
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
    C: Array
    D: Array
    CT: Array
    DT: Array
    off: Array
    lo: Array
    hi: Array
    names: tuple[tuple[str, int], ...]
    cost: Array
    box: Array
    objective: int
    scale: float
    solvable: bool
    solve: Array
    values: Array
    constants: Array
    cap: float = np.inf

    def redirected(self, p: Problem) -> Reduced:
        """The same grasp and scales, the smallest preload, with another disturbance in `p`."""
        load_ = load(p, self.goal)
        h = np.zeros(self.solve.shape[1])
        h[:6] = -load_.w_a
        y0 = self.solve @ h
        lo = self.lo.copy()
        lo[0] = 1.0 / search_end(p)
        D, DT = self.D, self.DT
        if self.names and self.names[-1][0] == "energy":
            D, DT = D.copy(), DT.copy()
            D[-2, :6] = DT[:6, len(D) - 2] = load_.w_a
        off = padded(self.values @ y0 + self.constants)
        return replace(self, p=p, load=load_, y0=y0, D=D, DT=DT, off=off, lo=lo)

    def beginning(self, box: tuple[float, float]) -> Reduced:
        """The same with another of `BOXES`."""
        n, nu = len(self.cost), self.M.shape[1]
        return replace(self, box=np.repeat(box, [nu, n - nu]))

    @cached_property
    def sizes(self) -> tuple[int, int, int]:
        """m contacts, a actuators that may move, F base values that are forces."""
        return len(self.p.mu), len(self.active), len(self.C)

    @cached_property
    def question(self) -> arrays.KernelQuestion:
        """What the kernel takes."""
        p, (m, a, F) = self.p, self.sizes
        return arrays.KernelQuestion(
            m=m,
            a=a,
            F=F,
            cos=float(np.cos(p.eta)),
            sin=float(np.sin(p.eta)),
            dissipation=p.mdp,
            objective=self.objective,
            capped=self.cap < np.inf,
            C=self.C,
            D=self.D,
            CT=self.CT,
            DT=self.DT,
            off=self.off,
            mu=p.mu,
            lo=self.lo,
            cost=self.cost,
            box=self.box,
            driven=self.driven,
        )

    @cached_property
    def table(self) -> Indices:
        """Of the question, for the kernel."""
        return table(self.question)

    def __getstate__(self) -> dict[str, Any]:
        """For another process: addresses mean nothing there."""
        return {name: value for name, value in self.__dict__.items() if name != "table"}

    @property
    def workspace(self) -> arrays.WorkspaceLayout:
        """What the kernel needs beside the question."""
        sizes = *self.sizes, len(self.cost), self.CT.shape[1], self.DT.shape[1], len(self.lo)
        return arrays.WorkspaceLayout.of(*sizes)

    def point(self, z: Array) -> Point:
        """The model's scaled unknowns."""
        p = self.p
        m, _, a, k = p.sizes
        nu = self.M.shape[1]
        x, y = self.M @ z[:nu], self.y0 + self.Y @ z[nu:]
        c = y[: 3 * m]
        f: Array = np.zeros(a)
        coupling = np.zeros(k)
        f[self.kept] = y[3 * m : 3 * m + len(self.kept)]
        rest = np.flatnonzero(~(p.moves | np.isfinite(p.f_max)))
        if len(rest) + k:
            out = pseudo_inverse(np.vstack([p.R[rest], p.A]).T) @ (p.J.T @ c - p.R.T @ f)
            f[rest], coupling = out[: len(rest)], np.array(out[len(rest) :])
        sigma = float(y[3 * m + len(self.kept)]) if self.objective else 0.0
        return Point(x[:6], x[6:], c, f, coupling, sigma)

    def scalar(self, z: Array) -> float:
        """The scalar of the question, its objective if a magnitude is sought, at reduced unknowns z (n,)."""
        return float(
            self.C[3 * self.sizes[0] + 2 * self.sizes[1]] @ z + self.off[3 * self.sizes[0] + 2 * self.sizes[1]]
        )

    def z(self, x: Point) -> Array:
        """The reduced unknowns nearest to a point of the model."""
        y = np.r_[x.c, x.f[self.kept]]
        if self.objective:
            y = np.r_[y, x.sigma]
        y = np.r_[y, np.zeros(len(self.y0) - len(y))]
        return np.r_[self.M.T @ np.r_[x.r, x.q], self.Y.T @ (y - self.y0)]


def reduce(
    p: Problem,
    goal: Goal,
    *,
    endless: bool = False,
    within: tuple[float, float] | None = None,
    cap: float = np.inf,
) -> Reduced:
    """Eliminate the linear equations of a question.

    Args:
        p: the scaled problem.
        goal: what is sought.
        endless: lambda of the smallest preload may be as large as it likes, so that small magnitudes count, too, and
            magnitudes up to `FARTHER` than usual; a largest magnitude, or commands that are sought, as large as they
            like.
        within: (lo, hi) bounds of what is made small (lambda, or -s), instead of those of a search; hi may be inf.
        cap: virtual motions beyond as many force scales are not searched.
    """
    m, l, a, _ = p.sizes
    endless = endless if within is None else not np.isfinite(within[1])
    drive, moves, load_ = p.driven, p.moves, load(p, goal)
    active = np.flatnonzero(moves)
    keep = moves | np.isfinite(p.f_max)
    kept = np.flatnonzero(keep)
    objective = {
        Goal.EXISTS: arrays.ANY,
        Goal.SMALLEST_PRELOAD: arrays.SCALAR,
        Goal.LARGEST: arrays.SCALAR,
        Goal.SMALLEST_MAX_TORQUE: arrays.LARGEST_EFFORT,
        Goal.SMALLEST_SUM_TORQUE: arrays.SUM_OF_EFFORTS,
    }[goal]
    efforts = np.flatnonzero(drive) if objective == arrays.SUM_OF_EFFORTS else np.zeros(0, int)
    lever = np.abs(p.command(np.ones(a)))  # N m or N per scaled actuator force
    scale = float(lever[drive].max()) if drive.any() else 1.0

    Q = null_space(np.vstack([p.A, p.R[~moves]])) if l else np.zeros((0, 0))
    M = np.zeros((6 + l, 6 + Q.shape[1]))
    M[:6, :6], M[6:, 6:] = np.eye(6), Q
    Z = Q if (keep == moves).all() else null_space(np.vstack([p.A, p.R[~keep]]))

    C, F, S = 3 * m, 3 * m + len(kept), 3 * m + len(kept) + (objective > 0)
    ny = S + len(efforts)
    E, h = np.zeros((6 + Z.shape[1] + (len(efforts) > 0), ny)), np.zeros(6 + Z.shape[1] + (len(efforts) > 0))
    E[:6, :C], h[:6] = p.G, -load_.w_a  # (1)
    if objective == arrays.SCALAR:
        E[:6, F] = load_.w_b
    E[6 : 6 + Z.shape[1], :C] = Z.T @ p.J.T  # (2)
    E[6 : 6 + Z.shape[1], C:F] = -Z.T @ p.R[kept].T
    if len(efforts):
        E[-1, F], E[-1, S:] = 1.0, -1.0
    U, sv, Vt = np.linalg.svd(E)
    rank = int((sv > RANK * sv[0]).sum())
    inverse = (Vt[:rank].T / sv[:rank]) @ U[:, :rank].T
    y0 = inverse @ h
    Y = Vt[rank:].T
    solvable = bool(np.abs(E @ y0 - h).max() < 1e-9)

    plain: list[tuple[str, int, float, float]] = []  # what is bounded, which, and between what
    if goal is Goal.SMALLEST_PRELOAD:
        last = FARTHER if endless else 1.0
        plain.append(("scalar", 0, 1.0 / (last * search_end(p)), np.inf if endless else HIGHEST))
    elif goal is Goal.LARGEST:
        plain.append(("scalar", 0, -np.inf if endless else -search_end(p), 0.0))
    elif objective:
        plain.append(("scalar", 0, 0.0, np.inf if endless else STRONGEST))
    if within is not None:
        plain[0] = ("scalar", 0, *within)
    if np.isfinite(p.cn_max):
        plain += [("normal", i, 0.0, p.cn_max) for i in range(m)]
    plain += [("force", int(i), -p.f_max[i], p.f_max[i]) for i in kept if np.isfinite(p.f_max[i])]
    plain += [("effort", int(i), 0.0, np.inf if endless else STRONGEST) for i in efforts]
    limits = len(plain)
    if cap < np.inf:
        plain += [("motion", i, -cap, cap) for i in range(6 + l)]
    if p.mdp and goal in (Goal.EXISTS, Goal.SMALLEST_PRELOAD) and not endless:  # for `rows.ENERGY`
        plain += [("energy", 0, -np.inf, np.inf), ("energy", 1, -np.inf, np.inf)]

    # base values: forces as functions of y, and their constants, motions as functions of (r, q)
    first = C + 2 * len(active)
    V, constants = np.zeros((first + limits, ny)), np.zeros(first + limits)
    V[:C, :C] = np.eye(C)
    force = {int(i): C + k for k, i in enumerate(kept)}
    effort = {int(i): S + k for k, i in enumerate(efforts)}
    for i, excess in zip(active.tolist(), range(C, first, 2), strict=True):
        V[excess, force[i]] = 1.0
        if drive[i]:
            V[excess + 1, effort.get(i, F)], V[excess + 1, force[i]] = 1.0, -lever[i] / scale
        else:
            constants[excess] = -load_.f_a[i]
            if objective:
                V[excess, F] -= load_.f_b[i]
    for k, (kind, i, _, _) in enumerate(plain[:limits], start=first):
        if kind == "scalar":
            V[k, F] = -1.0 if goal is Goal.LARGEST else 1.0
        else:
            V[k, 3 * i if kind == "normal" else force[i] if kind == "force" else effort[i]] = 1.0
    D = np.zeros((C + len(active) + len(plain) - limits, 6 + l))
    D[:C, :6], D[:C, 6:] = p.G.T, -p.J
    D[C : C + len(active), 6:] = p.R[active]
    if cap < np.inf:
        D[C + len(active) : C + len(active) + 6 + l] = np.eye(6 + l)
    if plain and plain[-1][0] == "energy":
        D[-2:, :6] = load_.w_a, load_.w_b
        D[-2:, 6:] = load_.f_a @ p.R, load_.f_b @ p.R
    nu, nv = M.shape[1], Y.shape[1]
    forces, motions = V @ Y, D @ M

    lo, hi = np.array([b[2] for b in plain]), np.array([b[3] for b in plain])
    cost = np.empty(nu + nv)
    cost[:nu] = 0.1 * PREFERENCE * motions[C : C + len(active)].sum(axis=0)
    cost[nu:] = PREFERENCE * forces[0:C:3].sum(axis=0)
    if objective:
        cost[nu:] += forces[first]
    cost += np.where(cost >= 0, 1.0, -1.0) * PERTURBATION * _NOISE[: len(cost)]
    box = np.repeat(BOXES[0], [nu, nv])
    if cap < np.inf:
        top = max(abs(v) for v in plain[0][2:]) if objective else 0.0
        c, f = _largest_forces(p, load_, cap, top, scale)
        y = np.concatenate([c, f[kept], np.full(ny - C - len(kept), top)])
        box = np.concatenate([np.abs(M).sum(axis=0) * cap, np.abs(Y).T @ (y + np.abs(y0))])
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
        C=np.hstack([np.zeros((len(forces), nu)), forces]),
        D=np.hstack([motions, np.zeros((len(motions), nv))]),
        CT=padded(forces.T),
        DT=padded(motions.T),
        off=padded(V @ y0 + constants),
        lo=lo,
        hi=hi,
        names=tuple((b[0], b[1]) for b in plain),
        cost=cost,
        box=box,
        objective=objective,
        scale=scale,
        solvable=solvable,
        solve=inverse,
        values=V,
        constants=constants,
        cap=cap,
    )


def _largest_forces(p: Problem, load_: Load, cap: float, top: float, scale: float) -> tuple[Array, Array]:
    """(3m,) and (a,) bounds of |c| and |f| for motions up to a cap, an objective up to `top`.

    c_n <= |d_n|, and by energy sum c_n^2 <= w . r + f_c . t where friction obeys the dissipation principle.
    """
    cn = (np.abs(p.G[:, 0::3]).sum(axis=0) + np.abs(p.J[0::3]).sum(axis=1)) * cap
    if p.mdp:
        sought = top * scale / np.abs(p.command(np.ones(len(p.R))))
        command = np.where(p.driven, sought, load_.f_a + top * load_.f_b)
        force = np.abs(load_.w_a) + top * np.abs(load_.w_b)
        cn = np.minimum(cn, np.sqrt((force.sum() + command @ np.abs(p.R).sum(axis=1)) * cap))
    cn = np.minimum(cn, p.cn_max)
    c = np.column_stack([cn, p.mu * cn, p.mu * cn]).reshape(-1)
    K = (np.abs(pseudo_inverse(np.vstack([p.R, p.A]).T)) @ np.abs(p.J.T))[: len(p.R)]
    return c, np.minimum(K @ c, p.f_max)
