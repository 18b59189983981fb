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
from typing import Any, NamedTuple

import numpy as np

from handfast.core.arrays import Array, Indices, Mask, times, transposed, transposed_times
from handfast.core.groups import table, whole_vectors
from handfast.proofs.question import AffineLoad
from handfast.proofs.states import State
from handfast.stability.problem.model import scaled
from handfast.stability.problem.objective import Objective, Range
from handfast.stability.problem.scaled_problem import ScaledPoint, ScaledProblem
from handfast.stability.problem.witness import Witness
from handfast.stability.search import arrays

PERTURBATION = 1e-10  # against ties. Nodes are closed by infeasibility only, which neither touches
# sizes of the grasp: how far from the origin its contacts may be before torques are taken about them
MAX_ORIGIN_DISTANCE = 100.0
SINGULAR_TOLERANCE = 1e-10  # relative: singular values below are none
EQUATION_TOLERANCE = 1e-9  # (scaled) what (1) and (2) may miss where they can be met
MIN_ACTUATOR_MOTION = 1e-12  # (scaled) motion from which an actuator turns
# (scaled) command of an actuator that turns without force, where commands are sought: with none at all it is locked.
# The judge grants far more; what it misses times a motion of 10^5 is still small.
NEXT_TO_NONE = 1e-13
LEAST_COMMAND = 1e-6  # (scaled) the same where such a state is not proved, and one is sought in which it carries this
# (scaled) motions and forces of the box where programs begin: far enough for most, near enough for rounding. What is
# near for one grasp is far for another, so that a search whose programs break down begins again with the next.
PROGRAM_BOXES = (1e4, 1e5), (1e5, 1e3), (1e6, 1e5), (1e4, 1e3), (1e5, 1e5)
# where a load is sought beside another one, or beside limits: programs break down from (1e4, 1e5) on most grasps
BOXES_OF_LARGEST = (1e4, 1e3), (1e5, 1e3), (1e4, 1e5), (1e6, 1e5), (1e5, 1e5)
_NOISE = 1 + np.random.default_rng(0).random(1024)


def noise(n: int) -> Array:
    """(n,) that no two unknowns share, against ties."""
    return _NOISE[:n]


def equilibrium(p: ScaledProblem, goal: Objective) -> Array:
    """(e, ny) the equations E of y that `reduce` eliminates."""
    return _balances(p, goal.scaled_load(p), _Forces.of(p, goal), _motions(p))[0]


class Uneven(ValueError):
    """Of many grasps at once some have equations of a lower rank than the others.

    Attributes:
        most: (k,) bool: those that have the highest.
    """

    def __init__(self, ranks: Indices) -> None:
        super().__init__("grasps of several ranks have no arrays of one shape")
        self.most: Mask = ranks == ranks.max()


def rank_of(sv: Array, least: float = 0.0) -> int:
    """From singular values (..., n), the largest first. Raises `Uneven` if those of many differ."""
    ranks = np.asarray((sv > SINGULAR_TOLERANCE * np.maximum(sv[..., :1], least)).sum(axis=-1))
    if ranks.ndim and (ranks != ranks[0]).any():
        raise Uneven(ranks)
    return int(ranks.flat[0])


def null_space(A: Array) -> Array:
    """(n, n - rank) orthonormal basis of the null space of A (k, n); of many (..., k, n) with zeros at one place."""
    n = A.shape[-1]
    if not A.shape[-2]:
        return np.eye(n)
    used = _one(A) != 0
    if (used.sum(axis=1) == 1).all():  # it only picks columns
        return np.eye(n)[:, ~used.any(axis=0)]
    _, s, Vt = np.linalg.svd(A)
    return transposed(Vt[..., rank_of(s, 1e-300) :, :])


def _one(A: Array) -> Array:
    """The first of many matrices."""
    return A if A.ndim == 2 else A[0]


def pseudo_inverse(A: Array) -> Array:
    """(n, k) of A (k, n), by hand if each column has one entry in a row of its own: a motor per joint.

    Of many (..., k, n) with zeros at one place.
    """
    used = _one(A) != 0
    if (used.sum(axis=0) == 1).all() and (used.sum(axis=1) <= 1).all():
        return transposed(np.divide(1.0, A, out=np.zeros(A.shape), where=A != 0))
    return np.asarray(np.linalg.pinv(A, rcond=1e-12), dtype=float)


def padded(x: Array) -> Array:
    """With zeros behind each row, for whole vectors of the processor."""
    out = np.zeros((*x.shape[:-1], whole_vectors(x.shape[-1])))
    out[..., : x.shape[-1]] = x
    return out


@dataclass(frozen=True, eq=False)
class Reduced:
    """The arrays of a search; of many grasps, as their problem is, with one more axis in front where these differ.

    Attributes:
        p, goal, load: the question.
        active: (a',) the actuators that may move, in the order of the base values; driven: (a',) bool.
        M: (6 + l, nu) basis of the motions; Y: (ny, nv), y0: (ny,): forces y = y0 + Y v with
            y = (c, f of `kept` actuators, scalar, efforts, torsions over levers).
        C, D: (., n) base values of `rows`, forces C z + off and motions D z + before; CT, DT: transposed, without the
            unknowns that are zero. These, off and before are filled with zeros up to whole vectors of the processor.
        lo, hi: (P,) bounds of the plain base values; names: what each of them bounds.
        box: (n,) where programs begin: |z| there.
        cap: largest (scaled) motion, inf without end; with one, z is within the box, which rays may cite.
        cost: (n,) objective over z, and what is preferred among equals.
        objective: what is sought, a constant of `arrays`.
        scale: [N m or N] per unit of the objective, for torques.
        solvable: can (1) and (2) be met at all?
        solve: (ny, e) pseudo-inverse of the equations; values, constants: base values over y. With them
            another disturbance of the same grasp is cheap, see `redirected`.
        of_torques: (e, l) what given torques are in the right-hand sides of the equations.
        least: (scaled) command of an actuator that turns, at least, where commands are sought.
        tries: are nodes split at what their children leave least?
        refuted: is it proved where there is no state at all?
    """

    p: ScaledProblem
    goal: Objective
    load: AffineLoad
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
    before: Array
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
    of_torques: Array
    cap: float = np.inf
    least: float = 0.0
    tries: bool = False
    refuted: bool = True

    @property
    def boxes(self) -> tuple[tuple[float, float], ...]:
        """Where its programs begin, in the order in which searches try them."""
        return BOXES_OF_LARGEST if self.goal.maximised else PROGRAM_BOXES

    @property
    def may_try(self) -> bool:
        """Do trials of children pay, where fewer nodes are worth more than their time as their proof is replayed?

        Where commands are sought and many other actuators may move, which stand for friction of joints.
        """
        return self.objective > arrays.SCALAR and int((~self.driven).sum()) >= arrays.MANY_ACTUATORS

    def beginning(self, box: tuple[float, float]) -> Reduced:
        """The same with another of its `boxes`."""
        n, nu = self.cost.shape[-1], self.M.shape[-1]
        return replace(self, box=np.repeat(box, [nu, n - nu]))

    @cached_property
    def sizes(self) -> tuple[int, int, int]:
        """m contacts, a actuators that may move, F base values that are forces."""
        return self.p.sizes[0], len(self.active), self.C.shape[-2]

    @cached_property
    def question(self) -> arrays.KernelQuestion:
        """What the kernel takes."""
        p, (m, a, F) = self.p, self.sizes
        return arrays.KernelQuestion(
            m=m,
            a=a,
            F=F,
            cos=float(np.cos(p.limits.eta)),
            sin=float(np.sin(p.limits.eta)),
            dissipation=p.mdp,
            objective=self.objective,
            capped=self.cap < np.inf,
            C=self.C,
            D=self.D,
            CT=self.CT,
            DT=self.DT,
            off=self.off,
            before=self.before,
            mu=p.mu,
            soft=self.soft_fingers,
            twist=F - len(p.soft),
            turning=3 * m + a + sum(name == "motion" for name, _ in self.names),
            lo=self.lo,
            cost=self.cost,
            box=self.box,
            driven=self.driven,
            least=self.least,
            tries=self.tries,
        )

    @cached_property
    def soft_fingers(self) -> Indices:
        """(m,) which soft finger a contact is, -1 for a point contact."""
        out: Indices = np.full(self.p.sizes[0], -1, np.int64)
        out[self.p.soft] = np.arange(len(self.p.soft))
        return out

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
        sizes = *self.sizes, self.cost.shape[-1], self.CT.shape[-1], self.DT.shape[-1], len(self.lo)
        return arrays.WorkspaceLayout.of(*sizes)

    def point(self, z: Array) -> ScaledPoint:
        """The model's scaled unknowns."""
        p = self.p
        m, _, a, k = p.sizes
        nu = self.M.shape[1]
        x, y = self.M @ z[:nu], self.y0 + self.Y @ z[nu:]
        c, twist = y[: 3 * m], y[len(y) - len(p.soft) :]
        f: Array = np.zeros(a)
        coupling = np.zeros(k)
        f[self.kept] = y[3 * m : 3 * m + len(self.kept)]
        scalar = float(y[3 * m + len(self.kept)]) if self.objective else 0.0
        rest = np.flatnonzero(~(p.moves | np.isfinite(p.f_max)))
        if len(rest) + k:
            torques = p.J.T @ c + p.twist_jacobian.T @ twist - p.R.T @ f - self.load.g_a - scalar * self.load.g_b
            out = pseudo_inverse(np.vstack([p.R[rest], p.A]).T) @ torques
            f[rest], coupling = out[: len(rest)], np.array(out[len(rest) :])
        return ScaledPoint(x[:6], x[6:], c, f, coupling, scalar, twist)

    def scalar(self, z: Array) -> float:
        """The objective at reduced unknowns z (n,), where a magnitude is sought: to the last bit that of `point`."""
        return self.goal.objective(self.point(z).scalar)

    def z(self, x: ScaledPoint) -> Array:
        """The reduced unknowns nearest to a point of the model."""
        y = [x.c, x.f[self.kept], np.full(1 if self.objective else 0, x.scalar)]
        y.append(np.zeros(len(self.y0) - sum(map(len, y)) - len(x.twist)))
        off = np.concatenate([*y, x.twist]) - self.y0
        return np.concatenate([self.M.T @ np.concatenate([x.r, x.q]), self.Y.T @ off])

    def at_magnitude(self, state: State, magnitude: float) -> Array:
        """The reduced unknowns (n,) nearest to a state, of a magnitude if one is sought, commands as they are."""
        if not self.goal.has_scalar:
            return self.z(self.p.scaled(state))
        scalar = self.goal.at_magnitude(self.p, magnitude)
        # where all is homogeneous, states are sought for the direction alone
        same = scaled(state, scalar) if self.goal.homogeneous else state
        return self.z(self.p.scaled(same, scalar, self.goal.given_share(scalar)))

    def witness(self, x: ScaledPoint) -> Witness:
        """A scaled point in the grasp's units, with the disturbance and the commands it belongs to.

        The commands are those of the load at its scalar, or what the driven actuators turned out to need.
        """
        p, load = self.p, self.load
        turns = p.R @ x.q > MIN_ACTUATOR_MOTION
        sought = np.where(turns, np.maximum(x.f, 0.0), 0.0)
        if (sought > NEXT_TO_NONE).any(where=p.driven):
            sought = np.where(turns & (x.f > -EQUATION_TOLERANCE), np.maximum(sought, NEXT_TO_NONE), 0.0)
        f_c = np.where(p.driven, sought, load.f_a + x.scalar * load.f_b)
        wrench = p.force * (load.w_a + x.scalar * load.w_b) / p.lengths
        share = self.goal.given_share(x.scalar)
        if (
            p.is_given and not wrench.any() and np.abs(x.c).max() < EQUATION_TOLERANCE
        ):  # rounding of what rests by itself
            x = replace(x, c=np.zeros(len(x.c)), twist=np.zeros(len(x.twist)))
        grasp = p.grasp.with_laws_times(share).with_preload(p.command(f_c, share))
        return Witness(grasp, wrench, p.unscale(x, share), p.limits.eta, p.mdp)


def reduce(
    p: ScaledProblem,
    goal: Objective,
    *,
    endless: bool = False,
    within: Range | None = None,
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
    endless = endless if within is None else not np.isfinite(within[1])
    load, at = goal.scaled_load(p), _Forces.of(p, goal)
    active = np.flatnonzero(p.moves)
    M = _motions(p)
    E, h, of_torques = _balances(p, load, at, M)
    about = _about_middle(p, E.shape[-2])
    U, sv, Vt = np.linalg.svd(E if about is None else about @ E)
    rank = rank_of(sv)
    inverse = (transposed(Vt[..., :rank, :]) / sv[..., None, :rank]) @ transposed(U[..., :rank])
    y0 = times(inverse, h if about is None else times(about, h))
    inverse = inverse if about is None else inverse @ about
    Y = transposed(Vt[..., rank:, :])
    of_forces = _force_bounds(p, goal, at, endless, within)
    of_motions = _motion_bounds(p, goal, endless and bool(load.f_b.any()), cap)
    plain = of_forces + of_motions
    V, constants = _force_rows(p, goal, load, at, active, of_forces)
    D = _motion_rows(p, load, active, of_motions)
    nu, nv = M.shape[-1], Y.shape[-1]
    forces, motions = V @ Y, D @ M
    cost = _cost(at, len(active), forces, motions)
    box = np.repeat(PROGRAM_BOXES[0], [nu, nv])
    if cap < np.inf:
        top = max(abs(plain[0].lo), abs(plain[0].hi)) if at.objective else 0.0
        c, f = _largest_forces(p, load, cap, top)
        twist = p.mu[p.soft] * c[3 * p.soft]
        y = np.concatenate([c, f[at.kept], np.full(at.twist - at.contacts - len(at.kept), top), twist])
        box = np.concatenate([np.abs(M).sum(axis=0) * cap, np.abs(Y).T @ (y + np.abs(y0))])
    return Reduced(
        p=p,
        goal=goal,
        load=load,
        active=active,
        kept=at.kept,
        driven=p.driven[active],
        M=M,
        Y=Y,
        y0=y0,
        C=np.concatenate([np.zeros((*forces.shape[:-1], nu)), forces], axis=-1),
        D=np.concatenate([motions, np.zeros((*motions.shape[:-1], nv))], axis=-1),
        CT=padded(transposed(forces)),
        DT=padded(transposed(motions)),
        off=padded(times(V, y0) + constants),
        before=padded(_before(p, active, motions.shape[-2])),
        lo=np.array([b.lo for b in plain]),
        hi=np.array([b.hi for b in plain]),
        names=tuple((b.kind, b.which) for b in plain),
        cost=cost,
        box=box,
        objective=at.objective,
        scale=p.command_unit,
        solvable=bool(np.abs(times(E, y0) - h).max() < EQUATION_TOLERANCE),
        solve=inverse,
        values=V,
        constants=constants,
        of_torques=of_torques,
        cap=cap,
    )


class _PlainBound(NamedTuple):
    """lo <= a plain base value <= hi; kind, which: what it bounds, and which of these."""

    kind: str
    which: int
    lo: float
    hi: float


@dataclass(frozen=True, eq=False)
class _Forces:
    """Where the forces are in y = (c, f of the kept actuators, scalar, one effort per driven actuator).

    Attributes:
        contacts: 3m, the length of c. scalar: place of the scalar, where there is one. size: the length of y.
        twist: where torsions begin, which end y.
        kept: (.,) actuators whose force is an unknown. efforts: (.,) actuators with an effort of their own.
        force, effort: place by actuator.
        objective: what is sought, a constant of `arrays`.
    """

    contacts: int
    scalar: int
    twist: int
    size: int
    kept: Indices
    efforts: Indices
    force: dict[int, int]
    effort: dict[int, int]
    objective: int

    @classmethod
    def of(cls, p: ScaledProblem, goal: Objective) -> _Forces:
        kept = np.flatnonzero(p.moves | np.isfinite(p.f_max))
        efforts = np.flatnonzero(p.driven) if goal.sums_commands else np.zeros(0, int)
        contacts = 3 * p.sizes[0]
        scalar = contacts + len(kept)
        first = scalar + goal.has_scalar
        force = {int(i): contacts + k for k, i in enumerate(kept)}
        effort = {int(i): first + k for k, i in enumerate(efforts)}
        objective = arrays.SCALAR if goal.has_scalar else arrays.ANY
        if goal.seeks_commands:
            objective = arrays.SUM_OF_EFFORTS if goal.sums_commands else arrays.LARGEST_EFFORT
        twist = first + len(efforts)
        return cls(contacts, scalar, twist, twist + len(p.soft), kept, efforts, force, effort, objective)


def _motions(p: ScaledProblem) -> Array:
    """(6 + l, nu) basis of the motions that couplings and locked actuators leave."""
    l = p.sizes[1]
    Q = null_space(_held(p, ~p.moves)) if l else np.zeros((0, 0))
    M = np.zeros((*Q.shape[:-2], 6 + l, 6 + Q.shape[-1]))
    M[..., :6, :6], M[..., 6:, 6:] = np.eye(6), Q
    return M


def _held(p: ScaledProblem, actuators: Mask) -> Array:
    """(., l) the rows of couplings and of some actuators."""
    return np.concatenate([p.A, p.R[..., actuators, :]], axis=-2)


def _balances(p: ScaledProblem, load: AffineLoad, at: _Forces, M: Array) -> tuple[Array, Array, Array]:
    """E y = h: (1), (2) against admissible motions of the joints, and the sum of efforts if sought; M: `_motions`.

    And (e, l) what given torques are in h.
    """
    kept = p.moves | np.isfinite(p.f_max)
    Z = M[..., 6:, 6:] if (kept == p.moves).all() else null_space(_held(p, ~kept))
    Zt = transposed(Z)
    joints = slice(6, 6 + Z.shape[-1])
    height = joints.stop + (len(at.efforts) > 0)
    many = p.G.shape[:-2]
    E, h = np.zeros((*many, height, at.size)), np.zeros((*many, height))
    E[..., :6, : at.contacts], h[..., :6] = p.G, -load.w_a  # (1)
    E[..., :6, at.twist :], E[..., joints, at.twist :] = p.twist_map, Zt @ transposed(p.twist_jacobian)
    if at.objective == arrays.SCALAR:
        E[..., :6, at.scalar] = load.w_b
        E[..., joints, at.scalar] = times(-Zt, load.g_b)
    E[..., joints, : at.contacts] = Zt @ transposed(p.J)  # (2)
    E[..., joints, at.contacts : at.scalar] = -Zt @ transposed(p.R[..., at.kept, :])
    if len(at.efforts):
        E[-1, at.scalar], E[-1, at.scalar + 1 : at.twist] = 1.0, -1.0
    of_torques = np.zeros((*many, height, p.torque.shape[-1]))
    of_torques[..., joints, :] = Zt
    h += times(of_torques, load.g_a)
    return E, h, of_torques


def _about_middle(p: ScaledProblem, height: int) -> Array | None:
    """(height, height) what turns torques on the object, rows 3 to 6 of (1), into those about the contacts' middle.

    Far from the origin the rounding of forces would be multiplied by the way there. None where none is beyond
    `MAX_ORIGIN_DISTANCE`.
    """
    far = np.linalg.norm(p.middle, axis=-1, keepdims=True) > MAX_ORIGIN_DISTANCE
    if not far.any():
        return None
    out = np.zeros((*p.G.shape[:-2], height, height))
    out[..., range(height), range(height)] = 1.0
    x, y, z = np.moveaxis(np.where(far, p.middle, 0.0), -1, 0)
    out[..., 3, 1], out[..., 3, 2] = z, -y
    out[..., 4, 2], out[..., 4, 0] = x, -z
    out[..., 5, 0], out[..., 5, 1] = y, -x
    return out


def _force_bounds(
    p: ScaledProblem, goal: Objective, at: _Forces, endless: bool, within: Range | None
) -> list[_PlainBound]:
    """Bounds of the objective, which comes first, and of forces."""
    lo, hi = within or goal.search_range(p, endless=endless) if goal.has_scalar else (0.0, 0.0)
    plain = [_PlainBound("scalar", 0, lo, hi)] if goal.has_scalar else []
    if np.isfinite(p.cn_max):
        plain += [_PlainBound("normal", i, 0.0, p.cn_max) for i in range(len(p.mu))]
    plain += [_PlainBound("force", int(i), -p.f_max[i], p.f_max[i]) for i in at.kept if np.isfinite(p.f_max[i])]
    most = goal.search_range(p, endless=endless)[1] if len(at.efforts) else 0.0
    plain += [_PlainBound("effort", int(i), 0.0, most) for i in at.efforts]
    return plain + [_PlainBound("twist", k, -np.inf, np.inf) for k in range(len(p.soft))]


def _motion_bounds(p: ScaledProblem, goal: Objective, unlimited: bool, cap: float) -> list[_PlainBound]:
    """Bounds of motions, if they have a cap; places of the turning of soft fingers, and of the balance of energy.

    unlimited: may commands be as large as they like?
    """
    plain = [_PlainBound("motion", i, -cap, cap) for i in range(6 + p.J.shape[1])] if cap < np.inf else []
    plain += [_PlainBound("turning", k, -np.inf, np.inf) for k in range(len(p.soft))]
    bounded = goal.bounds_energy and not (goal.homogeneous and p.equivalent.drives)
    if p.mdp and bounded and not unlimited:  # for `rows.ENERGY`
        plain += [_PlainBound("energy", i, -np.inf, np.inf) for i in range(2)]
    return plain


def _force_rows(
    p: ScaledProblem, goal: Objective, load: AffineLoad, at: _Forces, active: Indices, bounds: list[_PlainBound]
) -> tuple[Array, Array]:
    """Base values that are forces, V y + constants: c, complementarity slack and effort of active actuators, bounds."""
    C, units = at.contacts, p.command_units / p.command_unit
    first = C + 2 * len(active)
    many = p.G.shape[:-2]
    V, constants = np.zeros((*many, first + len(bounds), at.size)), np.zeros((*many, first + len(bounds)))
    V[..., :C, :C] = np.eye(C)
    for i, slack in zip(active.tolist(), range(C, first, 2), strict=True):
        V[..., slack, at.force[i]] = 1.0
        if p.driven[i]:
            V[..., slack + 1, at.effort.get(i, at.scalar)] = 1.0
            V[..., slack + 1, at.force[i]] = -units[..., i]
        else:
            constants[..., slack] = -load.f_a[..., i]
            if at.objective:
                V[..., slack, at.scalar] -= load.f_b[..., i]
    for k, (kind, i, _, _) in enumerate(bounds, start=first):
        if kind == "scalar":
            V[..., k, at.scalar] = goal.objective(1.0)
        else:
            places = {"normal": 3 * i, "force": at.force.get(i), "effort": at.effort.get(i), "twist": at.twist + i}
            V[..., k, places[kind]] = 1.0
    return V, constants


def _motion_rows(p: ScaledProblem, load: AffineLoad, active: Indices, bounds: list[_PlainBound]) -> Array:
    """(., 6 + l) base values that are motions over (r, q): d, t of the active actuators, bounds."""
    C, l = 3 * p.sizes[0], p.sizes[1]
    first = C + len(active)
    D = np.zeros((*p.G.shape[:-2], first + len(bounds), 6 + l))
    D[..., :C, :6], D[..., :C, 6:] = transposed(p.G), -p.J
    D[..., C:first, 6:] = p.R[..., active, :]
    if bounds and bounds[0].kind == "motion":
        D[..., first : first + 6 + l, :] = np.eye(6 + l)
        first += 6 + l
    turning = slice(first, first + len(p.soft))
    D[..., turning, :6], D[..., turning, 6:] = transposed(p.twist_map), -p.twist_jacobian
    if bounds and bounds[-1].kind == "energy":
        D[..., -2, :6], D[..., -1, :6] = load.w_a, load.w_b
        # without what friction takes, where it is sought
        D[..., -2, 6:], D[..., -1, 6:] = (
            transposed_times(p.R, f) + g for f, g in ((load.f_a, load.g_a), (load.f_b, 0.0))
        )
    return D


def _before(p: ScaledProblem, active: Indices, rows: int) -> Array:
    """(rows,) of `_motion_rows`: motions from before the step, along normals and of active actuators."""
    m, out = p.sizes[0], np.zeros(rows)
    out[: 3 * m : 3] = p.gaps / np.cos(p.limits.eta)
    out[3 * m : 3 * m + len(active)] = p.slack[active]
    return out


def _cost(at: _Forces, active: int, forces: Array, motions: Array) -> Array:
    """(n,) the objective over z, small forces and motions preferred; forces, motions: base values over z."""
    C, nu = at.contacts, motions.shape[-1]
    cost = np.empty((*forces.shape[:-2], nu + forces.shape[-1]))
    cost[..., :nu] = 0.1 * arrays.PREFERENCE * motions[..., C : C + active, :].sum(axis=-2)
    cost[..., nu:] = arrays.PREFERENCE * forces[..., 0:C:3, :].sum(axis=-2)
    if at.objective:
        cost[..., nu:] += forces[..., C + 2 * active, :]
    cost += np.where(cost >= 0, 1.0, -1.0) * PERTURBATION * noise(cost.shape[-1])
    return cost


def _largest_forces(p: ScaledProblem, load: AffineLoad, cap: float, top: float) -> tuple[Array, Array]:
    """(3m,) and (a,) bounds of |c| and |f| for motions up to a cap, an objective up to `top`.

    c_n <= |d_n|, and by energy sum c_n^2 + gap c_n <= w . r + f_c . t + g . q where friction obeys the dissipation
    principle.
    """
    cn = (np.abs(p.G[:, 0::3]).sum(axis=0) + np.abs(p.J[0::3]).sum(axis=1)) * cap + np.abs(p.gaps)
    if p.mdp:
        sought = top * p.command_unit / p.command_units
        command = np.where(p.driven, sought, load.f_a + top * load.f_b)
        force = np.abs(load.w_a) + top * np.abs(load.w_b)
        given = np.abs(load.g_a + top * load.g_b).sum()
        work = (force.sum() + command @ np.abs(p.R).sum(axis=1) + given) * cap + (p.gaps**2).sum()
        cn = np.minimum(cn, np.sqrt(work) + np.abs(p.gaps))
    cn = np.minimum(cn, p.cn_max)
    c = np.column_stack([cn, p.mu * cn, p.mu * cn]).reshape(-1)
    K = (np.abs(pseudo_inverse(np.vstack([p.R, p.A]).T)) @ np.abs(p.J.T))[: len(p.R)]
    carried = np.abs(pseudo_inverse(np.vstack([p.R, p.A]).T))[: len(p.R)] @ np.abs(load.g_a + top * load.g_b)
    return c, np.minimum(K @ c + carried, p.f_max)
