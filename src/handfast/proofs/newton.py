"""A box in which an exact solution of the equations of a state's modes is, in floating point.

In fixed modes (`states.Modes`) a state solves k smooth equations F(x) = 0 in n unknowns: motions (r, q), the forces
that no law gives, the magnitude where it is sought. Around the floats x0 a solution x0 + C y is looked for, with C
(n, k) about a right inverse of F'(x0). If |F(x0)| <= eta and |F'(x0 + C y) C - I| <= D for all |y| <= rho, and if
eta + D rho <= rho, then y -> y - F(x0 + C y) takes that box into itself and has a fixed point (Brouwer): an exact
solution within |C| rho of x0. Every rounding is bounded outward by sums of absolute values.

Rows of motion that are held may depend on each other by structure. Then some are kept, and that the others follow from
them is shown with rational numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from flint import fmpq, fmpq_mat, fmpz_mat, nmod_mat

from handfast.proofs.fields import Array, Integers, Mask, exact
from handfast.proofs.states import ContactMode, Laws, Modes, Numbers, Part, Problem, Rows, State
from handfast.proofs.tolerance import UNIT_ROUNDOFF

NEWTON_ROUNDS = 5  # for a box
BITS = 320  # of balls, see `balls`
PRIME = 2**61 - 1  # for ranks
DEPENDENT = 1e-9  # relative: rows whose distance from those before is less than this may depend on them


class NotShown(Exception):
    """Why nothing is shown in some modes; `part` is the contact, actuator or joint as `choices` names it.

    alone: it is so in this mode of the part, whatever the modes of the others.
    """

    def __init__(self, reason: str, part: str = "", rounding: bool = False, alone: bool = False) -> None:
        super().__init__(reason)
        self.part, self.rounding, self.alone = part, rounding, alone


@dataclass(frozen=True, eq=False)
class Box:
    """Motions v (6 + l,), d (N + 1,) and forces phi (N + 1,) of all rows, and the magnitude, each with a radius.

    carried: (a,) what each actuator carries beyond its command at least, where more digits than floats' tell.
    """

    v: Array
    v_off: Array
    d: Array
    d_off: Array
    phi: Array
    phi_off: Array
    magnitude: float = 0.0
    magnitude_off: float = 0.0
    carried: Array | None = None


@dataclass(frozen=True, eq=False)
class ModeEquations:
    """F(x) = 0 in some modes: (1) and (2), motions that are held, normal forces at their limit.

    Over floats, balls or rational numbers: M is `GraspData.rows` in these, `number` makes them of floats.

    Attributes:
        p, modes: the problem and the modes.
        rows: the laws. kept: held rows that the others follow from. full: of the contacts that press, at the limit.
        printed: (N + 1,) forces as they are in the file.
        sought: is the magnitude an unknown?
    """

    p: Problem
    modes: Modes
    rows: Rows
    kept: Integers
    full: Integers
    printed: Array
    sought: bool

    @classmethod
    def of(cls, p: Problem, modes: Modes, x: State, sought: bool) -> ModeEquations:
        """`NotShown` where held rows follow from each other but for rounding."""
        rows = Rows.of(p, modes)
        kept = independent(p, np.flatnonzero(rows.held), rows)
        if kept is None:
            raise NotShown("what is held at rest is dependent but for rounding", between(modes))
        return cls(p, modes, rows, kept, np.flatnonzero(modes.full[modes.closed]), x.forces(p.grasp), sought)

    @cached_property
    def unknown(self) -> Integers:
        """Rows whose forces are unknowns."""
        return np.flatnonzero(self.rows.unknown)

    @property
    def idle(self) -> Mask:
        """(6 + l,) balances that read 0 = 0: nothing loads them, nor has any row that may carry a part in them."""
        p, g, carries = self.p, self.p.grasp, self.rows.unknown | (self.rows.given != 0)
        carries[g.contact_rows[self.modes.closed]] = True
        load = p.wrench if p.along is None else np.where(p.along != 0, 1.0, p.wrench)
        idle = ~g.rows[1][carries].any(axis=0) & (np.concatenate([load, g.torque]) == 0)
        return ~(g.exact_table[carries] != 0).any(axis=0) & idle if idle.any() else idle

    def at(
        self, M: Array, x: Array, number: Numbers = np.array, smooth: bool = True
    ) -> tuple[Array, Array, Laws, Array]:
        """Motions d and forces phi (N + 1,), the contacts' laws, and what is missed (k,) at unknowns x (n,).

        smooth: as of `Laws.of`.
        """
        p, g, nv = self.p, self.p.grasp, M.shape[1]
        d, phi, magnitude = M @ x[:nv], number(self.rows.given), x[-1] if self.sought else number(p.magnitude)
        laws = Laws.of(p, self.modes, d, self.printed, number, smooth)
        phi[laws.rows] = laws.force
        phi[self.unknown] = x[nv : nv + len(self.unknown)]
        phi[-1] = number(0.0)
        load = number(np.concatenate([p.wrench, g.torque]))
        if p.along is not None:
            load[:6] += magnitude * number(p.along)
        at = self.rows.exact if M.dtype == object else self.rows.at
        above = laws.force[self.full, 0] - number(p.force_limit) if len(self.full) else laws.force[:0, 0]
        return d, phi, laws, np.concatenate([M.T @ phi + load, (d - at)[self.kept], above])

    def derivative(self, M: Array, K: Array, along: Array) -> Array:
        """(k, n) of what is missed by the unknowns, with K (c, 4, 4) of the contacts' laws; along: (6,)."""
        B, nv, n = M[self.p.grasp.contact_rows[self.modes.closed]], M.shape[1], len(self.unknown)
        KB = K @ B
        A = np.zeros((nv + len(self.kept) + len(self.full), nv + n + self.sought), dtype=M.dtype)
        A[:nv, :nv] = B.reshape(-1, nv).T @ KB.reshape(-1, nv)
        A[:nv, nv : nv + n] = M[self.unknown].T
        if self.sought:
            A[:6, -1] = along
        A[nv : nv + len(self.kept), :nv] = M[self.kept]
        A[nv + len(self.kept) :, :nv] = KB[self.full, 0]
        return A


@dataclass(frozen=True, eq=False)
class System:
    """The equations in some modes, linearised at the floats x0; n unknowns, k equations.

    Attributes:
        of_modes: the equations.
        v, phi: (6 + l,), (N + 1,) motions and forces; those of the contacts follow from v.
        d, d_off, phi_off: motions (N + 1,), and what rounding leaves open of motions and forces.
        laws: forces of the contacts. K_off: (n,) what rounding leaves open of their derivatives.
        value, value_off: (k,) what the equations miss at x0. A, A_size: (k, n) derivatives. units: (k,) for scaling.
        used: (k,) which equations these are; others follow from them, exactly.
        residual: the largest of all equations and laws, relative to the scale of the load.
    """

    of_modes: ModeEquations
    v: Array
    phi: Array
    d: Array
    d_off: Array
    phi_off: Array
    laws: Laws
    K_off: Array
    value: Array
    value_off: Array
    A: Array
    A_size: Array
    units: Array
    used: Integers
    residual: float

    @classmethod
    def of(cls, p: Problem, modes: Modes, x: State, free: bool) -> System:
        """free: is the magnitude an unknown, if there is one? Raises `NotShown`."""
        e = ModeEquations.of(p, modes, x, free and p.along is not None and bool(p.along.any()))
        g, (M, size), v, rows, unit = p.grasp, p.grasp.rows, x.motion, e.rows, rounding(p)
        start = np.concatenate([v, e.printed[e.unknown], [p.magnitude] * e.sought])
        d, phi, laws, value = e.at(M, start)
        d_off = unit * (size @ np.abs(v))
        off = d_off[laws.rows]
        change = laws.change(p, np.sqrt((off**2).sum(axis=1)))
        if not np.isfinite(change).all():
            part = f"contact {np.flatnonzero(modes.closed)[np.argmax(change)]}"
            raise NotShown(f"{part} slides by so little that its direction is not known", part, alone=True)
        # rounding of what slides, a few ulp of mu (1 + c_n / |d_t|), is below `change`: `off` is 64 ulp of d or more
        K_off = change + 32 * UNIT_ROUNDOFF
        force_off = _times(np.abs(laws.K), off) + (K_off * off.sum(axis=1))[:, None]
        force_off += laws.rounding(p, d)[:, None]
        phi_off = np.zeros(len(phi))
        phi_off[laws.rows] = force_off
        phi_off[e.unknown] = 0.0

        along = np.zeros(6) if p.along is None else p.along
        load_size = np.concatenate([np.abs(p.wrench) + np.abs(p.magnitude * along), np.abs(g.torque)])
        missing_off = unit * (size.T @ np.abs(phi) + load_size) + size.T @ phi_off
        at_off = d_off + 4 * UNIT_ROUNDOFF * np.abs(rows.at)
        above_off = force_off[e.full, 0] + 4 * UNIT_ROUNDOFF * np.abs(value[len(v) + len(e.kept) :])
        value_off = np.concatenate([missing_off, at_off[e.kept], above_off])
        units = np.concatenate([g.column_units, 1.0 / g.row_units[e.kept], np.ones(len(e.full))])
        A, A_size = e.derivative(M, laws.K, along), e.derivative(size, np.abs(laws.K), np.abs(along))
        missed = value * units, (d - rows.at)[rows.held] / g.row_units[rows.held], (phi - e.printed) * g.row_units
        residual = float(max(np.abs(x).max(initial=0.0) for x in missed) / p.scale)
        used = np.flatnonzero(~np.concatenate([e.idle, np.zeros(len(value) - len(v), dtype=bool)]))
        bounds = value[used], value_off[used], A[used], A_size[used], units[used], used, residual
        system = cls(e, v, phi, d, d_off, phi_off, laws, K_off, *bounds)
        return system if system.regular else system._without_dependent()

    @property
    def p(self) -> Problem:
        return self.of_modes.p

    @property
    def modes(self) -> Modes:
        return self.of_modes.modes

    @property
    def sought(self) -> bool:
        """Is the magnitude an unknown?"""
        return self.of_modes.sought

    @cached_property
    def regular(self) -> bool:
        """Has A a right inverse that is not too large?"""
        try:
            C = self.inverse
        except NotShown:
            return False
        scaled = C / self.units / self.columns[:, None]
        return bool(np.abs(scaled).max(initial=0.0) < 1.0 / DEPENDENT)

    def _without_dependent(self) -> System:
        """Without equations that others follow from, if they do so exactly; else as it is."""
        scaled = self.units[:, None] * self.A * self.columns
        kept = greedy(scaled / np.maximum(np.linalg.norm(scaled, axis=1, keepdims=True), 1e-300))
        others = np.delete(np.arange(len(scaled)), kept)
        if not len(others) or not self.linear[others].all():
            return self
        basis, dropped = ([self.exact[i] for i in some] for some in (kept[self.linear[kept]], others))
        if not spans(basis, dropped):
            return self
        parts = {name: getattr(self, name)[kept] for name in ("value", "value_off", "A", "A_size", "units", "used")}
        return replace(self, **parts)

    @property
    def contradictory(self) -> bool:
        """Do the linear equations contradict each other, exactly?"""
        every = [self.exact[i] for i in np.flatnonzero(self.linear)]
        return bool(nmod_mat(_integers(every), PRIME).rank() > _integers([row[:-1] for row in every]).rank())

    @cached_property
    def linear(self) -> Mask:
        """(k,) which equations are linear in the unknowns."""
        e, turns = self.of_modes, np.isfinite(self.laws.speed)
        curved = (self.p.grasp.exact_table[self.laws.rows[turns].ravel()] != 0).any(axis=0)
        return ~np.concatenate([curved, np.zeros(len(e.kept), dtype=bool), turns[e.full]])[self.used]

    @cached_property
    def exact(self) -> list[list[fmpq]]:
        """(k, n + 1) derivatives and what is missed of the equations that are linear, exactly; others mean nothing."""
        e, p, M = self.of_modes, self.p, self.p.grasp.exact_table
        start = np.concatenate([self.v, self.phi[e.unknown], [p.magnitude] * self.sought])
        _, _, laws, value = e.at(M, exact(start), exact, smooth=False)
        A = e.derivative(M, laws.K, exact(np.zeros(6) if p.along is None else p.along))
        return [[*row, y] for row, y in zip(A[self.used].tolist(), value[self.used], strict=True)]

    @cached_property
    def columns(self) -> Array:
        """(n,) that scale the unknowns."""
        g = self.p.grasp
        parts = [g.column_units, 1.0 / g.row_units[self.of_modes.unknown]]
        if self.sought and self.p.along is not None:
            parts.append(1.0 / np.abs(self.p.along * g.column_units[:6]).max(keepdims=True))
        return np.concatenate(parts)

    @cached_property
    def inverse(self) -> Array:
        """(n, k) about a right inverse of A. Raises `NotShown`."""
        columns = self.columns
        scaled = self.units[:, None] * self.A * columns
        k, n = scaled.shape
        if k > n:
            part = between(self.modes)
            raise NotShown(f"{k} equations have only {n} unknowns: {part or 'a part'} is between two modes", part)
        try:
            if k == n:
                out = np.linalg.inv(scaled)
            else:
                Q, R = np.linalg.qr(scaled.T)
                out = Q @ np.linalg.inv(R).T
        except np.linalg.LinAlgError:
            raise NotShown("the equations of the modes lose rank", between(self.modes)) from None
        return np.asarray(columns[:, None] * out * self.units)

    def fails(self, rounding: bool) -> NotShown:
        said = f"Newton's test fails at a residual of {self.residual:.1e}"
        return NotShown(said if rounding else f"{said}, with {BITS} bits, too", between(self.modes), rounding)

    def box(self) -> Box:
        """A box about x0 in which an exact solution is. Raises `NotShown`."""
        p, e, laws, (M, size), nv = self.p, self.of_modes, self.laws, self.p.grasp.rows, len(self.v)
        unit = rounding(p)
        value = np.abs(self.value) + self.value_off
        C = self.inverse if value.any() else np.zeros(self.A.T.shape)
        Cv = np.abs(C[:nv])
        moved = np.abs(M @ C[:nv]) + unit * (size @ Cv)
        turned, spread = moved[laws.rows].sum(axis=1), np.zeros((nv + len(e.kept), len(laws.rows)))
        spread[:nv] = size[laws.rows].sum(axis=1).T
        spread = np.concatenate([spread, np.eye(len(laws.rows))[e.full]])[self.used]
        error = np.abs(self.A @ C - np.eye(len(value))) + unit * (self.A_size @ np.abs(C))
        radius = value * (1 + 1e-6)

        def changes(radius: Array) -> tuple[Array, Array]:
            """Of the derivatives of the contacts' forces, and of the motions that these come from."""
            off = moved[laws.rows] @ radius + self.d_off[laws.rows]
            return laws.change(p, np.sqrt((off**2).sum(axis=1))) + self.K_off, off

        for _ in range(NEWTON_ROUNDS):
            by_contact = changes(radius)[0] * (turned @ radius)
            if not np.isfinite(by_contact).all():
                raise self.fails(True)
            grown = value + error @ radius
            grown += spread @ by_contact
            if (grown <= radius).all():
                break
            radius = 1.2 * grown
        else:
            raise self.fails(True)
        d_off, phi_off, (change, off) = moved @ radius + self.d_off, self.phi_off.copy(), changes(radius)
        rounded = laws.rounding(p, self.d)
        phi_off[laws.rows] = _times(np.abs(laws.K), off) + (change * off.sum(axis=1) + rounded)[:, None]
        away = np.abs(C[nv:]) @ radius
        phi_off[e.unknown] = away[: len(e.unknown)]
        s_off = float(away[-1]) if self.sought else 0.0
        phi_off[-1] = 0.0
        held, at = e.rows.held, e.rows.at
        at_off = 2 * UNIT_ROUNDOFF * np.abs(at)
        d, d_off = np.where(held, at, self.d), np.where(held, at_off, d_off)
        return Box(self.v, Cv @ radius, d, d_off, self.phi, phi_off, p.magnitude, s_off)


def between(modes: Modes) -> str:
    """A part that is between two modes; "" if none is."""
    contact, actuator, joint = modes.contact, modes.actuator, modes.joint
    for i in np.flatnonzero((contact == ContactMode.TOUCHES) | (contact == ContactMode.LEANS) | modes.full):
        return f"contact {i}"
    for j in np.flatnonzero((actuator == Part.LOW) | (actuator == Part.HIGH) | (actuator == Part.LOWEST)):
        return f"actuator {j}"
    for j in np.flatnonzero((joint == Part.LOW) | (joint == Part.HIGH)):
        return f"joint {j}"
    return ""


def rounding(p: Problem) -> float:
    """At most the relative error of a sum over rows or columns, of products of numbers that were rounded before."""
    return 4 * (sum(p.grasp.rows[0].shape) + 16) * UNIT_ROUNDOFF


def _times(K: Array, x: Array) -> Array:
    """(n, i) of K (n, i, j) and x (n, j)."""
    out: Array = (K * x[:, None, :]).sum(axis=2)
    return out


# --- held rows that depend on each other -----------------------------------------------------------


def independent(p: Problem, held: Integers, rows: Rows) -> Integers | None:
    """Of rows that are held, some that the others follow from, exactly; None if they follow but for rounding."""
    known, key = p.grasp.independent_rows, held.tobytes() + rows.at[held].tobytes()
    if key not in known:
        known[key] = _independent(p, held, rows)
    return known[key]


def _independent(p: Problem, held: Integers, rows: Rows) -> Integers | None:
    H = p.grasp.rows[0][held] * p.grasp.column_units / p.grasp.row_units[held, None]
    if not len(H):
        return held
    if len(H) <= H.shape[1] and np.abs(np.diag(np.linalg.qr(H.T)[1])).min() > DEPENDENT:
        return held
    chosen = greedy(H)
    whole = [[*p.grasp.exact_rows[k], fmpq(rows.exact[k])] for k in held.tolist()]
    basis, others = [whole[k] for k in chosen], [whole[k] for k in np.delete(np.arange(len(whole)), chosen)]
    return held[chosen] if spans(basis, others) else None


def greedy(rows: Array) -> Integers:
    """Which rows are farther than `DEPENDENT` from the span of those before."""
    basis, chosen = np.zeros(rows.shape), list[int]()
    for k, row in enumerate(rows):
        B = basis[: len(chosen)]
        rest = row - (B @ row) @ B
        rest -= (B @ rest) @ B
        away = math.sqrt(rest @ rest)
        if away > DEPENDENT:
            basis[len(chosen)] = rest / away
            chosen.append(k)
    return np.array(chosen, dtype=np.int64)


def spans(basis: list[list[fmpq]], others: list[list[fmpq]]) -> bool:
    """Are the others sums of the basis' rows, exactly? Ranks modulo a prime, never above ranks, spare most of it."""
    every, own = _integers(basis + others), _integers(basis)
    if nmod_mat(every, PRIME).rank() > len(basis):
        return False
    full = nmod_mat(own, PRIME).rank() == len(basis)
    return bool(every.rank() == (len(basis) if full else own.rank()))


def _integers(rows: list[list[fmpq]]) -> fmpz_mat:
    """Rows of rational numbers times a common denominator."""
    return fmpq_mat(rows).numer_denom()[0]
