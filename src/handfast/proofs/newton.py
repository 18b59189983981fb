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

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from flint import fmpq_mat

from handfast.proofs.fields import Array, Integers
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
    """Motions d (N + 1,) and forces phi (N + 1,) of all rows, and the magnitude, each with a radius."""

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
        balanced: are (1) and (2) among the equations, and forces and magnitude among the unknowns?
        rows: the laws. kept: held rows that the others follow from. full: (n,) of `laws`, whose force is the limit.
        v, phi: (6 + l,), (N + 1,) motions and forces; those of the contacts follow from v.
        sought: (6 + l,) what a unit of magnitude adds to (1) and (2); 0 if there is no magnitude.
        d, d_off, phi_off: motions (N + 1,), and what rounding leaves open of motions and forces.
        laws: forces of the contacts. K_off: (n,) what rounding leaves open of their derivatives.
        value, value_off: (k,) what the equations miss at x0, scaled by `units` (k,). A, A_size: (k, n) derivatives.
        residual: the largest of all equations and laws, relative to the scale of the load.
    """

    p: Problem
    modes: Modes
    balanced: bool
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
    residual: float

    @classmethod
    def of(cls, p: Problem, modes: Modes, x: State, balanced: bool, free: bool) -> System:
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
        force_off += 16 * ULP * (np.abs(d[laws.rows]).sum(axis=1) + np.abs(laws.force).sum(axis=1))[:, None]
        phi = rows.given + p.magnitude * rows.drive
        phi_off = 4 * ULP * np.abs(p.magnitude * rows.drive)
        phi[laws.rows] += laws.force
        phi_off[laws.rows] += force_off
        phi[rows.unknown] = printed[rows.unknown]
        phi_off[rows.unknown] = 0.0
        phi[-1] = phi_off[-1] = 0.0

        along = np.zeros(6) if p.along is None else p.along
        load = np.r_[p.load, g.torque]
        load_size = np.abs(np.r_[np.abs(p.wrench) + np.abs(p.magnitude * along), g.torque])
        sought = (np.r_[along, np.zeros(g.l)] + M.T @ rows.drive) * free
        missing = M.T @ phi + load
        missing_off = unit * (size.T @ np.abs(phi) + load_size) + size.T @ phi_off
        held = np.flatnonzero(rows.held)
        kept = independent(p, held)
        if kept is None:
            raise NotShown("what is held at rest is dependent but for rounding", between(modes))
        full = np.flatnonzero(modes.full[modes.closed])
        above = laws.force[full, 0] - p.force_limit
        value = np.r_[missing, d[kept], above]
        value_off = np.r_[missing_off, d_off[kept], force_off[full, 0] + 4 * ULP * np.abs(above)]
        units = np.r_[p.grasp.column_units, 1.0 / p.grasp.row_units[kept], np.ones(len(full))]
        A, A_size = _derivative(p, rows, kept, full, laws, sought)
        gap = (phi - printed) * p.grasp.row_units
        residual = (
            max(np.abs(x).max(initial=0.0) for x in (value * units, d[held] / p.grasp.row_units[held], gap)) / p.scale
        )
        if not balanced:
            nv = len(v)
            A, A_size, value, value_off, units = A[nv:, :nv], A_size[nv:, :nv], value[nv:], value_off[nv:], units[nv:]
        args = d, d_off, phi_off, laws, K_off, value, value_off, A, A_size, units, float(residual)
        return cls(p, modes, balanced, rows, kept, full, v, phi, sought, *args)

    @cached_property
    def inverse(self) -> Array:
        """(n, k) about a right inverse of A. Raises `NotShown`."""
        p = self.p
        columns = p.grasp.column_units
        if self.balanced:
            columns = np.r_[columns, 1.0 / p.grasp.row_units[self.rows.unknown]]
            if self.sought.any():
                columns = np.r_[columns, 1.0 / np.abs(self.sought * p.grasp.column_units).max()]
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
        value = np.abs(self.value) + self.value_off
        C = self.inverse if value.any() else np.zeros(self.A.T.shape)
        p, laws, (M, size), nv = self.p, self.laws, self.p.grasp.rows, len(self.v)
        unit, Cv = rounding(p), np.abs(C[:nv])
        moved = np.abs(M @ C[:nv]) + unit * (size @ Cv)
        turned, spread = moved[laws.rows].sum(axis=1), size[laws.rows].sum(axis=1)
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
            if self.balanced:
                grown[:nv] += spread.T @ by_contact
            grown[len(grown) - len(self.full) :] += by_contact[self.full]
            if (grown <= radius).all():
                break
            radius = 1.2 * grown
        else:
            raise self.fails(True)
        d_off, phi_off, (change, off) = moved @ radius + self.d_off, self.phi_off.copy(), changes(radius)
        rounded = 16 * ULP * (np.abs(self.d[laws.rows]).sum(axis=1) + np.abs(laws.force).sum(axis=1))
        phi_off[laws.rows] = _times(np.abs(laws.K), off) + (change * off.sum(axis=1) + rounded)[:, None]
        phi_off[self.rows.unknown] = 0.0
        s_off = 0.0
        if self.balanced:
            away = np.abs(C[nv:]) @ radius
            phi_off[self.rows.unknown] = away[: self.rows.unknown.sum()]
            s_off = float(away[-1]) if self.sought.any() else 0.0
        phi_off[-1] = 0.0
        phi_off += np.abs(self.rows.drive) * s_off
        held = self.rows.held
        return Box(np.where(held, 0.0, self.d), np.where(held, 0.0, d_off), self.phi, phi_off, p.magnitude, s_off)


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


def independent(p: Problem, held: Integers) -> Integers | None:
    """Of rows that are held, some that the others follow from, exactly; None if they follow but for rounding."""
    known, key = p.grasp.independent_rows, held.tobytes()
    if key not in known:
        known[key] = _independent(p, held)
    return known[key]


def _independent(p: Problem, held: Integers) -> Integers | None:
    H = p.grasp.rows[0][held] * p.grasp.column_units / p.grasp.row_units[held, None]
    if not len(H):
        return held
    if len(H) <= H.shape[1] and np.abs(np.diag(np.linalg.qr(H.T)[1])).min() > DEPENDENT:
        return held
    basis, kept = np.zeros((0, H.shape[1])), []
    for k, row in zip(held, H, strict=True):
        rest = row - basis.T @ (basis @ row)
        rest -= basis.T @ (basis @ rest)
        if np.linalg.norm(rest) > DEPENDENT:
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
            kept.append(k)
    exact = p.grasp.exact_rows
    rank = fmpq_mat([exact[k] for k in held]).numer_denom()[0].rank()
    return np.array(kept, dtype=held.dtype) if rank == len(kept) else None
