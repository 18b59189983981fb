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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from flint import fmpq, fmpq_mat

from handfast.proofs.fields import Array, Integers, rational, rationals
from handfast.proofs.states import ULP, Contact, Laws, Modes, Part, Problem, Rows, State

ROUNDS = 5  # for a box
BITS = 320  # of balls, see `balls`
DEPENDENT = 1e-9  # relative: rows whose distance from those before is less than this may depend on them


class NotShown(Exception):
    """Why nothing is shown in some modes; `part` is the contact, actuator or joint as `choices` names it."""

    def __init__(self, reason: str, part: str = "", rounding: bool = False) -> None:
        super().__init__(reason)
        self.part, self.rounding = part, rounding


@dataclass(frozen=True, eq=False)
class Box:
    """Motions v (6 + l,), d (N + 1,) and forces phi (N + 1,) of all rows, and the magnitude, each with a radius."""

    v: Array
    v_off: Array
    d: Array
    d_off: Array
    phi: Array
    phi_off: Array
    magnitude: float = 0.0
    magnitude_off: float = 0.0


@dataclass(frozen=True, eq=False)
class System:
    """The equations in some modes, linearised at the floats x0; n unknowns, k equations.

    Attributes:
        p, modes: the problem and the modes.
        rows: the laws. kept: held rows that the others follow from. full: (n,) of `laws`, whose force is the limit.
        v, phi: (6 + l,), (N + 1,) motions and forces; those of the contacts follow from v.
        sought: (6 + l,) what a unit of magnitude adds to (1) and (2); 0 if the magnitude is no unknown.
        d, d_off, phi_off: motions (N + 1,), and what rounding leaves open of motions and forces.
        laws: forces of the contacts. K_off: (n,) what rounding leaves open of their derivatives.
        value, value_off: (k,) what the equations miss at x0. A, A_size: (k, n) derivatives. units: (k,) for scaling.
        used: (k,) which equations these are; others follow from them, exactly.
        residual: the largest of all equations and laws, relative to the scale of the load.
    """

    p: Problem
    modes: Modes
    rows: Rows
    kept: Integers
    full: Integers
    v: Array
    phi: Array
    sought: Array
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
        g, (M, size), v = p.grasp, p.grasp.rows, x.motion
        unit = rounding(p)
        d, d_off = M @ v, unit * (size @ np.abs(v))
        printed = x.forces(g)
        rows, laws = Rows.of(p, modes), Laws.of(p, modes, d, printed)
        off = d_off[laws.rows]
        change = laws.change(p, np.sqrt((off**2).sum(axis=1)))
        if not np.isfinite(change).all():
            part = f"contact {np.flatnonzero(modes.closed)[np.argmax(change)]}"
            raise NotShown(f"{part} slides by so little that its direction is not known", part)
        still = np.where(np.isfinite(laws.speed), laws.speed, 1.0)
        steep = np.divide(np.abs(laws.force[:, 0]), still, out=np.zeros(len(still)), where=still > 0)
        K_off = change + 32 * ULP * (1.0 + laws.rub * (1.0 + steep))
        force_off = _times(np.abs(laws.K), off) + (K_off * off.sum(axis=1))[:, None]
        force_off += laws.rounding(p, d)[:, None]
        phi, phi_off = rows.given.copy(), np.zeros(len(rows.given))
        phi[laws.rows] += laws.force
        phi_off[laws.rows] += force_off
        phi[rows.unknown] = printed[rows.unknown]
        phi_off[rows.unknown] = 0.0
        phi[-1] = phi_off[-1] = 0.0

        along = np.zeros(6) if p.along is None else p.along
        load = np.r_[p.load, g.torque]
        load_size = np.abs(np.r_[np.abs(p.wrench) + np.abs(p.magnitude * along), g.torque])
        sought = np.r_[along, np.zeros(g.l)] * free
        missing = M.T @ phi + load
        missing_off = unit * (size.T @ np.abs(phi) + load_size) + size.T @ phi_off
        held = np.flatnonzero(rows.held)
        kept = independent(p, held, rows)
        if kept is None:
            raise NotShown("what is held at rest is dependent but for rounding", between(modes))
        full = np.flatnonzero(modes.full[modes.closed])
        above = laws.force[full, 0] - p.force_limit
        value = np.r_[missing, (d - rows.at)[kept], above]
        at_off = d_off + 4 * ULP * np.abs(rows.at)
        value_off = np.r_[missing_off, at_off[kept], force_off[full, 0] + 4 * ULP * np.abs(above)]
        units = np.r_[p.grasp.column_units, 1.0 / p.grasp.row_units[kept], np.ones(len(full))]
        A, A_size = _derivative(p, rows, kept, full, laws, sought)
        gap = (phi - printed) * p.grasp.row_units
        residual = (
            max(np.abs(x).max(initial=0.0) for x in (value * units, (d - rows.at)[held] / p.grasp.row_units[held], gap))
            / p.scale
        )
        args = (
            d,
            d_off,
            phi_off,
            laws,
            K_off,
            value,
            value_off,
            A,
            A_size,
            units,
            np.arange(len(value)),
            float(residual),
        )
        system = cls(p, modes, rows, kept, full, v, phi, sought, *args)
        return system if system.regular else system._without_dependent()

    @property
    def regular(self) -> bool:
        """Has A a right inverse that is not too large?"""
        k, n = self.A.shape
        if k > n:
            return False
        try:
            C = self.inverse
        except NotShown:
            return False
        scaled = C / self.units / self.columns[:, None]
        return bool(np.abs(scaled).max(initial=0.0) < 1.0 / DEPENDENT)

    def _without_dependent(self) -> System:
        """Without equations that others follow from, if they do so exactly; else as it is."""
        scaled = self.units[:, None] * self.A * self.columns
        exact = exact_equations(self)
        order = sorted(range(len(exact)), key=lambda i: exact[i] is not None)  # what is not linear first
        chosen = greedy(scaled[order] / np.maximum(np.linalg.norm(scaled[order], axis=1, keepdims=True), 1e-300))
        used = np.sort(np.array(order, dtype=np.int64)[chosen])
        dropped = [exact[i] for i in np.setdiff1d(np.arange(len(exact)), used)]
        basis = [row for row in (exact[i] for i in used) if row is not None]
        if not dropped or any(row is None for row in dropped) or rank_of(basis) < rank_of(basis + dropped):
            return self
        parts = {name: getattr(self, name)[used] for name in ("value", "value_off", "A", "A_size", "units")}
        return replace(self, **parts, used=used)

    @cached_property
    def columns(self) -> Array:
        """(n,) that scale the unknowns."""
        g = self.p.grasp
        parts = [g.column_units, 1.0 / g.row_units[self.rows.unknown]]
        if self.sought.any():
            parts.append(1.0 / np.abs(self.sought * g.column_units).max(keepdims=True))
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
        p, laws, (M, size), nv = self.p, self.laws, self.p.grasp.rows, len(self.v)
        unit, unknown = rounding(p), self.rows.unknown
        value = np.abs(self.value) + self.value_off
        C = self.inverse if value.any() else np.zeros(self.A.T.shape)
        Cv = np.abs(C[:nv])
        moved = np.abs(M @ C[:nv]) + unit * (size @ Cv)
        turned, spread = moved[laws.rows].sum(axis=1), np.zeros((nv + len(self.kept), len(laws.rows)))
        spread[:nv] = size[laws.rows].sum(axis=1).T
        spread = np.concatenate([spread, np.eye(len(laws.rows))[self.full]])[self.used]
        error = np.abs(self.A @ C - np.eye(len(value))) + unit * (self.A_size @ np.abs(C))
        radius = value * (1 + 1e-6)

        def changes(radius: Array) -> tuple[Array, Array]:
            """Of the derivatives of the contacts' forces, and of the motions that these come from."""
            off = moved[laws.rows] @ radius + self.d_off[laws.rows]
            return laws.change(p, np.sqrt((off**2).sum(axis=1))) + self.K_off, off

        for _ in range(ROUNDS):
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
        phi_off[unknown] = away[: unknown.sum()]
        s_off = float(away[-1]) if self.sought.any() else 0.0
        phi_off[-1] = 0.0
        held = self.rows.held
        at, at_off = self.rows.at, 2 * ULP * np.abs(self.rows.at)
        d, d_off = np.where(held, at, self.d), np.where(held, at_off, d_off)
        return Box(self.v, Cv @ radius, d, d_off, self.phi, phi_off, p.magnitude, s_off)


def between(modes: Modes) -> str:
    """A part that is between two modes; "" if none is."""
    for i in np.flatnonzero(np.isin(modes.contact, (Contact.TOUCHES, Contact.LEANS)) | modes.full):
        return f"contact {i}"
    for j in np.flatnonzero(np.isin(modes.actuator, (Part.LOW, Part.HIGH, Part.LOWEST))):
        return f"actuator {j}"
    for j in np.flatnonzero(np.isin(modes.joint, (Part.LOW, Part.HIGH))):
        return f"joint {j}"
    return ""


def rounding(p: Problem) -> float:
    """At most the relative error of a sum over rows or columns, of products of numbers that were rounded before."""
    return 4 * (sum(p.grasp.rows[0].shape) + 16) * ULP


def _times(K: Array, x: Array) -> Array:
    """(n, i) of K (n, i, j) and x (n, j)."""
    out: Array = (K * x[:, None, :]).sum(axis=2)
    return out


def _derivative(
    p: Problem, rows: Rows, kept: Integers, full: Integers, laws: Laws, sought: Array
) -> tuple[Array, Array]:
    """(k, n) derivatives of (1), (2), held rows and normal forces at their limit; and what bounds their rounding."""
    has = bool(sought.any())
    nv, n = len(sought), int(rows.unknown.sum())
    out = []
    for M, K, more in zip(p.grasp.rows, (laws.K, np.abs(laws.K)), (sought, np.abs(sought)), strict=True):
        B = M[laws.rows]
        KB = K @ B
        A = np.zeros((nv + len(kept) + len(full), nv + n + has))
        A[:nv, :nv] = B.reshape(-1, nv).T @ KB.reshape(-1, nv)
        A[:nv, nv : nv + n] = M[rows.unknown].T
        if has:
            A[:nv, -1] = more
        A[nv : nv + len(kept), :nv] = M[kept]
        A[nv + len(kept) :, :nv] = KB[full, 0]
        out.append(A)
    return out[0], out[1]


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
    exact = [[*p.grasp.exact_rows[k], rows.exact.get(k, fmpq(0))] for k in held.tolist()]
    return held[chosen] if rank_of(exact) == len(chosen) else None


def greedy(rows: Array) -> Integers:
    """Which rows are farther than `DEPENDENT` from the span of those before."""
    basis, chosen = np.zeros((0, rows.shape[1])), []
    for k, row in enumerate(rows):
        rest = row - basis.T @ (basis @ row)
        rest -= basis.T @ (basis @ rest)
        if np.linalg.norm(rest) > DEPENDENT:
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
            chosen.append(k)
    return np.array(chosen, dtype=np.int64)


def rank_of(rows: Sequence[Sequence[fmpq] | None]) -> int:
    """Of rows of rational numbers, exactly."""
    return int(fmpq_mat([row for row in rows if row is not None]).numer_denom()[0].rank()) if rows else 0


def exact_equations(s: System) -> list[list[fmpq] | None]:
    """(k, n + 1) coefficients and constants of the equations that are linear, exactly; None for the others."""
    p, M, nv = s.p, s.p.grasp.exact_rows, len(s.v)
    unknown, has = np.flatnonzero(s.rows.unknown).tolist(), int(p.along is not None)
    n = nv + len(unknown) + has + 1
    zero, magnitude = fmpq(0), rational(p.magnitude)

    def affine(motions: Sequence[fmpq] = (), by_magnitude: fmpq = zero, constant: fmpq = zero) -> list[fmpq]:
        row = [*(motions or [zero] * nv), *[zero] * (n - nv)]
        row[-1] = constant if has else constant + magnitude * by_magnitude
        if has:
            row[-2] = by_magnitude
        return row

    forces: list[list[fmpq] | None]
    forces = [affine(constant=x) for x in rationals(s.rows.given)]
    for rows, speed, lean in zip(s.laws.rows.tolist(), s.laws.speed, s.laws.lean, strict=True):
        for k, share in zip(rows, [1.0, *lean], strict=True):
            slope = -rational(p.cos) * rational(share)
            pressed = -rational(p.grasp.gaps[rows[0] // 3]) * rational(share)
            forces[k] = affine([slope * x for x in M[rows[0]]], constant=pressed) if np.isinf(speed) else None
    forces[-1] = affine()
    for i, k in enumerate(unknown):
        forces[k] = [fmpq(int(j == nv + i)) for j in range(n)]
    along = rationals(np.zeros(6) if p.along is None else p.along) + [zero] * p.grasp.l
    out: list[list[fmpq] | None] = []
    for a, load in enumerate(rationals(np.concatenate([p.wrench, p.grasp.torque]))):
        parts = [(M[k][a], forces[k]) for k in range(len(M)) if M[k][a] != 0]
        total: list[fmpq] | None = affine((), along[a], load)
        for x, force in parts:
            total = None if total is None or force is None else [t + x * y for t, y in zip(total, force, strict=True)]
        out.append(total)
    out += [affine(M[k], constant=-s.rows.exact.get(k, zero)) for k in s.kept.tolist()]
    for i in s.full:
        force = forces[s.laws.rows[i, 0]]
        out.append(None if force is None else [*force[:-1], force[-1] - rational(p.force_limit)])
    return out
