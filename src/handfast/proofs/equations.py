"""The model's equalities and motions of a question as matrices, rounded and exactly, and by how much loads may be off.

Of the unknowns x (`rows.Columns`): E x = h are (1), (2), couplings, (8) where nothing is commanded, and the sum of
commands; Z x are the motions (3): d of the contacts, t of the actuators, the work of given torques by them [W at unit
stiffness], turning of soft fingers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from handfast.proofs.fields import Array, Integers, Mask, cross_rows, rationals
from handfast.proofs.grasp import GraspData
from handfast.proofs.question import TORQUES, Question, Range
from handfast.proofs.rows import Columns
from handfast.proofs.tolerance import EPS, UNIT_ROUNDOFF, WORK, load_scale, slack_units

SEEMS = 1e-9  # relative: motions of a contact that are this near to dependent ones may be so
ENTRY_ROUNDING = 64 * UNIT_ROUNDOFF  # relative error of an entry of G and J, of its sum of absolute values


@dataclass(frozen=True, eq=False)
class Equations:
    """Of a question, but for the right-hand side: what questions with other loads on the same grasp share.

    Attributes:
        columns: of x.
        E, Z: (p, n), (3m+a+1+s, n), entries of G, J and given torques rounded.
        E_size, Z_size: sums of the absolute values of what entries are made of: |rounded - exact| <= `ENTRY_ROUNDING`
            size, and 0 only where the exact entry is.
        about: (p, p) that turns multipliers of forces of (1) into those of forces through the contacts' centroid.
        joint_units: (l',) of `GraspData`; of sliders, whose motion is a mean of others', the least.
        grasp, given: for exact numbers: (l',) torques that are given to joints.
    """

    columns: Columns
    E: Array
    Z: Array
    E_size: Array
    Z_size: Array
    about: Array
    joint_units: Array
    grasp: GraspData
    given: list[fmpq]

    @cached_property
    def scale(self) -> Array:
        """(n,) powers of two by which unknowns are scaled; forces of contacts have 1."""
        motions = np.delete(self.Z_size, len(self.Z) - len(self.grasp.soft) - 1, axis=0)  # work is none
        largest = np.maximum(self.E_size.max(axis=0, initial=0.0), motions.max(axis=0, initial=0.0))
        out = power_near(largest)
        out[self.columns.c] = 1.0
        return 1.0 / out

    @cached_property
    def solved(self) -> tuple[Integers, Integers]:
        """(k,) each: rows of E, and unknowns that are in no other row, times 1 or -1.

        These are efforts of actuators with a joint of their own: each is what (2) says, and may be put in for it.
        """
        f, at = self.E[:, self.columns.f], np.arange(self.columns.n)[self.columns.f]
        alone = ((f != 0).sum(axis=0) == 1) & (np.abs(f).sum(axis=0) == 1)
        rows, first = np.unique(np.abs(f[:, alone]).argmax(axis=0), return_index=True)
        return rows, at[alone][first]

    @cached_property
    def unit(self) -> Array:
        """(p,) powers of two: the rows of E, scaled, over these are of like size."""
        return power_near((self.E_size * self.scale).max(axis=1, initial=0.0))

    @cached_property
    def inverse(self) -> Array:
        """(n, p) pseudo-inverse of the scaled E without what is `solved`."""
        E, (rows, columns) = self.E * self.scale / self.unit[:, None], self.solved
        E[rows], E[:, columns] = 0.0, 0.0
        return np.asarray(np.linalg.pinv(E, rcond=1e-12), dtype=np.float64)

    @cached_property
    def of_contacts(self) -> Integers:
        """(3m + s,) rows of Z: motions at contacts, then the turning of soft fingers."""
        m, s = self.grasp.m, len(self.grasp.soft)
        return np.r_[: 3 * m, len(self.Z) - s : len(self.Z)]

    @cached_property
    def touching(self) -> Integers:
        """(3m + s,) unknowns that are forces of contacts, as `of_contacts`: then torsions of soft fingers."""
        at = self.columns
        return np.r_[at.c.start : at.c.stop, at.twist.start : at.twist.stop]

    @cached_property
    def reached(self) -> Mask:
        """(n,) bool: unknowns that are bounded where motions are: these, and forces of contacts."""
        at, out = self.columns, np.zeros(self.columns.n, dtype=bool)
        for part in (at.r, at.q, at.c, at.twist):
            out[part] = True
        return out

    @cached_property
    def _arms(self) -> Array:
        """(n,) how large unknowns but r are where motions are 1 N at most, see `reach`; 0 for what nothing bounds.

        A contact's |d_n| is at most that of the object, once for its way and once for its turn, and that of its joints;
        c_n <= |d_n|, |c_t| <= mu c_n, and so the torsion over the lever. In a step of a load's path c_n <=
        |d_n| + |gap|, for motions that are no less than the gaps: `LeafSystems.proved`.
        """
        at, g, out = self.columns, self.grasp, np.zeros(self.columns.n)
        out[at.q] = 1.0 / self.joint_units
        normal = (2.0 + g.sizes[1][0::3] @ (1.0 / g.joint_units)) * (1 + 1e-6)  # and what they may slip besides
        normal = normal + g.gaps.any()
        out[at.c] = np.column_stack([normal, g.mu * normal, g.mu * normal]).ravel()
        out[at.twist] = (g.mu * normal)[g.soft]
        return out

    def reach(self, rest: Array, off: Array) -> Array:
        """(L,) upper bounds on |rho x| over all x whose motions are 1 N at most, for all rho within off (L, n) of rest.

        These are measured by `tolerance.motion_size`. Of unknowns that they do not bound, rho has to be 0.
        """
        g, at = self.grasp, self.columns
        force, torque = rest[:, :3], rest[:, 3:6]
        arm = float(np.linalg.norm(g.centroid))

        def length(x: Array) -> Array:  # squares would underflow
            return np.asarray(np.hypot.reduce(x, axis=1))

        about = torque - cross_rows(g.centroid, force)
        rounding = 16 * UNIT_ROUNDOFF * (length(torque) + arm * length(force))
        turns = (length(about) + rounding + length(off[:, 3:6]) + arm * length(off[:, :3])) / g.size
        own = (
            length(force)
            + length(off[:, :3])
            + turns
            + (np.abs(rest) + off)[:, at.q.start :] @ self._arms[at.q.start :]
        )
        return np.asarray(own * (1 + 1e-9))

    @cached_property
    def _exact(self) -> tuple[list[list[fmpq]], list[list[fmpq]]]:
        """E and Z as rational numbers."""
        at, g = self.columns, self.grasp
        E, Z = ([rationals(row) for row in A] for A in (self.E, self.Z))
        turning = len(Z) - len(g.soft)
        Z[turning - 1][at.q] = self.given
        of_contacts = zip([*range(3 * g.m), *range(turning, len(Z))], g.exact_rows, strict=False)
        for place, (k, motion) in zip(self.touching, of_contacts, strict=True):
            Z[k][: 6 + g.l] = motion
            for row, x in zip(E, [*motion[:6], *(-y for y in motion[6:])], strict=False):
                row[place] = x
        if self.E[6 : 6 + len(self.given), at.scalar].any():
            for row, x in zip(E[6:], self.given, strict=False):
                row[at.scalar.start] = -x
        return E, Z

    @cached_property
    def moved(self) -> Mask:
        """(m, n) which contacts an unknown motion moves."""
        g = self.grasp
        return np.asarray((self.Z_size[: 3 * g.m] > 0).reshape(g.m, 3, -1).any(axis=1))

    @cached_property
    def dependent_joints(self) -> list[tuple[int, Mask]]:
        """Contacts where the motions by their joints seem to be dependent; (n,) bool: these joints.

        Numbers without rounding are not made for it: `rank_at` decides, and a contact that is missing proves less.
        """
        joints, at = np.zeros_like(self.moved), self.columns.q
        joints[:, at] = self.moved[:, at]
        by = (self.Z * self.scale)[: 3 * len(joints)].reshape(len(joints), 3, -1) * joints[:, None]
        ranks = np.linalg.matrix_rank(by, tol=SEEMS * np.abs(by).max(axis=(1, 2), initial=0.0))
        return [(k, joints[k]) for k in np.flatnonzero(joints.sum(axis=1) > ranks).tolist()]

    def rank_at(self, contact: int, columns: tuple[int, ...]) -> int:
        """Exactly, the rank of a contact's motion over some unknowns."""
        if (contact, columns) not in self._ranks:
            Z = self._exact[1][3 * contact : 3 * contact + 3]
            self._ranks[contact, columns] = fmpq_mat([[row[j] for j in columns] for row in Z]).rank()
        return self._ranks[contact, columns]

    @cached_property
    def _ranks(self) -> dict[tuple[int, tuple[int, ...]], int]:
        return {}

    def exact_rows(self, values: Array, equalities: Integers, columns: Integers) -> list[list[fmpq]]:
        """(k + k', c) rows of `row_values` (k, n+3m+a+1+s), then some of E, over some of x alone, exactly."""
        (E, Z), n, out = self._exact, self.columns.n, [rationals(row) for row in values[:, columns]]
        moved = np.flatnonzero(values[:, n:].any(axis=0))
        if len(moved) and len(columns):
            motions = fmpq_mat([[Z[k][j] for j in columns] for k in moved])
            out = (fmpq_mat(out) + fmpq_mat([rationals(row) for row in values[:, n + moved]]) * motions).tolist()
        return out + [[E[k][j] for j in columns] for k in equalities]


def power_near(x: Array) -> Array:
    """Powers of two near numbers; 1 for 0."""
    return np.asarray(np.exp2(np.round(np.log2(np.where(x > 0, x, 1.0)))))


@dataclass(frozen=True)
class _Asked:
    key: tuple[Any, ...]
    question: Question = field(compare=False)


def equations_of(q: Question) -> Equations:
    """Those of a question; kept, as a prepared grasp is asked again and again."""
    e, load = q.equivalent, q.load
    arrays = (e.R, e.A, q.sense, q.may_move, q.is_driven, load.w_b)
    return _made(_Asked((q.grasp, q.goal, q.sums, *(x.tobytes() for x in arrays), tuple(e.exact)), q))


@lru_cache(maxsize=32)
def _made(asked: _Asked) -> Equations:
    q = asked.question
    g = q.grasp
    E, Z = _assembled(q, (g.G, g.J, g.twist_map, g.twist_jacobian))
    E_size, Z_size = (np.abs(x) for x in _assembled(q, g.sizes))
    about = np.eye(len(E))
    x, y, z = g.centroid
    about[:3, 3:6] = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # v_force + v_torque x centroid
    units = np.append(g.joint_units, np.full(q.joints - g.l, g.joint_units.min(initial=g.size)))
    return Equations(Columns.of(q), E, Z, E_size, Z_size, about, units, g, q.equivalent.exact)


def _assembled(q: Question, maps: tuple[Array, Array, Array, Array]) -> tuple[Array, Array]:
    """E and Z from G, J, the twist map and the twist Jacobian of the grasp's joints."""
    g, e, at = q.grasp, q.equivalent, Columns.of(q)
    G, J, twist_map, twist_jacobian = maps
    R, A, own = q.sense[:, None] * e.R, e.A, slice(6, 6 + g.l)
    locked = np.flatnonzero(~q.may_move)
    b2, b3, b4, p = (6 + np.cumsum([q.joints, len(A), len(locked), int(at.e.stop > at.e.start)])).tolist()
    E = np.zeros((p, at.n))
    E[:6, at.c], E[:6, at.twist], E[:6, at.scalar] = G, twist_map, q.load.w_b[:, None]  # (1)
    E[own, at.c], E[own, at.twist] = J.T, twist_jacobian.T  # (2); nothing touches sliders
    E[6:b2, at.f], E[6:b2, at.coupling], E[6:b2, at.scalar] = -R.T, -A.T, -q.load.g_b[:, None]
    E[b2:b3, at.q] = A
    E[b3:b4, at.q] = R[locked]  # (8) where nothing is commanded
    if p > b4:
        E[b4:, at.scalar], E[b4:, at.e] = 1.0, -q.is_driven.astype(float)
    c, t = 3 * g.m, 3 * g.m + len(R)
    Z = np.zeros((t + 1 + len(g.soft), at.n))
    Z[:c, at.r], Z[:c, own], Z[c:t, at.q], Z[t, at.q] = G.T, -J, R, e.torque  # (3)
    Z[t + 1 :, at.r], Z[t + 1 :, own] = twist_map.T, -twist_jacobian
    return E, Z


@dataclass(frozen=True, eq=False)
class RightSide:
    """What load and commands make of E x = h.

    Attributes:
        h: (p,) rounded; exact: the same as rational numbers.
        slack, growth: (p,) E x = h may be missed by slack + |scalar| growth, (1) about the contacts' centroid.
        slip, slip_growth: [N] likewise each contact's motion d, as a vector, beside Z x.
        energy: by how much the balance of energy may be missed.
        scale: [N] of the load. ends: of the scalar, 0 and 0 without.
    """

    h: Array
    exact: list[fmpq]
    slack: Array
    growth: Array
    slip: float
    slip_growth: float
    energy: float
    scale: float
    ends: Range

    @classmethod
    def of(cls, q: Question, scalar: Range | None, p: int) -> RightSide:
        """Of a question with its scalar in a range.

        The slack is that of `tolerance`, in all of (1), (2) and (3) and in nothing else: couplings, (8) and the added
        sliders behind joints with friction are there exactly. A state whose joint torques are off by as much is one of
        the equivalent whose joints are, while the two forces on a slider add up to 2 F by what they are. What is
        missed does work, too: `tolerance` allows WORK F^2 of it.
        """
        g, load = q.grasp, q.load
        h = np.zeros(p)
        h[:6], h[6 : 6 + q.joints] = -load.w_a, load.g_a
        exact = rationals(h)
        if load.g_a.any():
            exact[6 : 6 + q.joints] = q.equivalent.exact
        units = np.zeros(p)
        units[: 6 + g.l] = slack_units(g)
        of_load, grows = 0.0, 0.0
        if load.w_b.any():
            grows = load_scale(g, load.w_b)
        if load.w_a.any() or not load.w_b.any() or (scalar is not None and scalar[0] <= 0.0 <= scalar[1]):
            of_load = load_scale(g, load.w_a)
        if q.goal == TORQUES and not load.w_a.any():  # the commands that are sought are the largest thing there is
            R = np.abs(g.R[q.sought]) / g.joint_units
            grows = float(R.max(initial=0.0))
        ends = scalar or (0.0, 0.0)
        slack, growth = EPS * of_load, EPS * grows
        most = max(of_load, grows)
        return cls(h, exact, slack * units, growth * units, slack, growth, WORK * of_load * of_load, most, ends)

    def costs(self, q: Equations, v: Array, change: Array, z: Array, z_change: Array) -> tuple[Array, Array]:
        """(L,) upper bounds on what slack and growth take, for multipliers that differ from these by change at most.

        v: (L, p) of E x = h. z: (L, 3m+s) of motions at contacts, then of turning.
        """
        size = np.abs(v @ q.about.T) + (change + 16 * UNIT_ROUNDOFF * np.abs(v)) @ np.abs(q.about.T)
        m, soft = q.grasp.m, q.grasp.soft
        slips = np.zeros((len(z), m, 4))
        far = np.abs(z) + z_change
        slips[:, :, :3] = far[:, : 3 * m].reshape(-1, m, 3)
        slips[:, soft, 3] = far[:, 3 * m :]
        slipped = np.hypot.reduce(slips, axis=2).sum(axis=1)
        slack, growth = size @ self.slack + slipped * self.slip, size @ self.growth + slipped * self.slip_growth
        return slack * (1 + 1e-9), growth * (1 + 1e-9)

    def grown(self, grows: Array, pushes: Array) -> Array:
        """(L,) how much of a margin what grows with the scalar can take.

        The multiplier of the scalar's first end grows with the scalar, too. Where that is faster, the first end is the
        worst; else the farther one is.
        """
        first, last = abs(self.ends[0]), max(abs(x) for x in self.ends)
        end = np.where(pushes >= grows, first, last)
        return np.multiply(grows, end, out=np.zeros_like(grows), where=grows > 0) * (1 + 1e-9)
