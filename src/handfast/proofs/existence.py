"""That a state exists exactly: near the floats of a file there is a solution of the equations in their modes.

In fixed modes (`states.Modes`) a state solves p smooth equations F(x) = 0 in n unknowns: motions (r, q), the forces
that no law gives, the magnitude where it is sought. Around the floats x0 a solution x0 + C y is looked for, with C (n, p)
an approximate right inverse of F'(x0). If |F(x0)| <= eta and |F'(x0 + C y) C - I| <= D for all |y| <= rho, and
eta + D rho <= rho, then y -> y - F(x0 + C y) takes the box into itself and has a fixed point there (Brouwer): an exact
state, within |C| rho of x0. The inequalities of the modes have to be strict all over that box, or are equations of the
modes. First in floating point, with every rounding bounded outward by sums of absolute values; where that is too coarse,
in FLINT's balls after Newton's method with as many digits.

Rows of motion that are held may depend on each other by structure. Then some are kept, and that the others follow from
them is shown with rational numbers.

What cannot be shown exactly may hold to `tolerance.EPS` of load and commands: motions that keep every row that is held
exactly, forces that obey every law exactly, and (1) and (2) missed by no more than that.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from flint import arb, arb_mat, ctx, fmpq, fmpq_mat

from handfast.proofs.fields import Array, Integers
from handfast.proofs.grasp import GraspData
from handfast.proofs.rational import dot, rationals, rounded
from handfast.proofs.states import (
    ULP,
    Contact,
    Laws,
    Modes,
    Part,
    Problem,
    Rows,
    State,
    acting,
    choices,
    modes_of,
    reaction_ends,
    sense,
)
from handfast.proofs.tolerance import EPS

NEAR = 1e-6  # relative to the forces that act: how far the state that is proved may be from the printed one
TRIES = 16  # modes that are tried
ROUNDS = 5  # for a box
BITS = 320  # of balls
DEPENDENT = 1e-9  # relative: rows whose distance from those before is less than this may depend on them


@dataclass(frozen=True)
class Proved:
    """What is proved of a state.

    Attributes:
        exact: is there an exact state within `radius` of it? tolerant: if not, one to 1e-9 of load and commands?
        reason: why not exactly; "" if it is.
        residual: what the floats themselves miss, relative to the scale of the load.
        radius: [N] how far from the floats the forces and motions at the contacts are at most.
        margin: the least by which an inequality of the modes is strict, relative to the forces that act.
        magnitude: between which the magnitude of the exact state is, where that is an unknown.
        modes: by contact, actuator and joint.
    """

    exact: bool
    tolerant: bool
    reason: str
    residual: float
    radius: float = np.inf
    margin: float = 0.0
    magnitude: tuple[float, float] | None = None
    modes: dict[str, str] = field(default_factory=dict)


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


def prove(p: Problem, x: State) -> Proved:
    """Is there an exact state of the problem near x?"""
    done = _attempts(p, x, balanced=True)
    if done.exact:
        return done
    rough = _attempts(p, x, balanced=False)
    return replace(done, tolerant=rough.tolerant, modes=rough.modes, magnitude=rough.magnitude)


def _attempts(p: Problem, x: State, balanced: bool) -> Proved:
    """Modes that x may have, one after the other. balanced: exactly, else but for the slack in (1) and (2)."""
    options = choices(p, x)
    chosen, reason, residual = dict.fromkeys(options, 0), "", np.inf
    for _ in range(TRIES):
        modes = modes_of(p.grasp, {name: options[name][k] for name, k in chosen.items()})
        try:
            system = System.of(p, modes, x, balanced)
            residual = min(residual, system.residual)
            try:
                return _shown(system, x, system.box(), residual)
            except NotShown as fault:
                if not fault.rounding:
                    raise
                return _shown(system, x, refined(system), residual)
        except NotShown as fault:
            reason = reason or str(fault)
            if fault.part not in options or chosen[fault.part] + 1 >= len(options[fault.part]):
                break
            chosen[fault.part] += 1
    return Proved(False, False, reason, residual)


def _shown(s: System, x: State, box: Box, residual: float) -> Proved:
    """What a box shows. Raises `NotShown`."""
    p = s.p
    if not s.balanced:
        box = _within(p, s.modes, box)
        _within_slack(p, box)
    margin, radius = _margin(p, s.modes, box), _radius(p, x, box)
    off = box.magnitude_off + 4 * ULP * abs(box.magnitude)
    ends = (box.magnitude - off, box.magnitude + off) if s.sought.any() else None
    words = s.modes.words(p.grasp)
    return Proved(s.balanced, not s.balanced, "", residual, radius, margin, ends, words)


@dataclass(frozen=True, eq=False)
class System:
    """The equations in some modes, linearised at the floats x0; n unknowns, k equations.

    Attributes:
        p, modes: the problem and the modes. balanced: are (1) and (2) among the equations, all unknowns besides motions?
        loose: do held rows depend on each other but for rounding? Then none is among the equations.
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
    loose: bool
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
    def of(cls, p: Problem, modes: Modes, x: State, balanced: bool) -> System:
        """Raises `NotShown`."""
        g, (M, size), v = p.grasp, p.rows, x.motion
        unit = _unit(p)
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
        sought = np.r_[along, np.zeros(g.l)] + M.T @ rows.drive
        missing = M.T @ phi + load
        missing_off = unit * (size.T @ np.abs(phi) + load_size) + size.T @ phi_off
        held = np.flatnonzero(rows.held)
        kept = independent(p, held)
        loose = kept is None
        if kept is None:
            if balanced:
                raise NotShown("what is held at rest is dependent but for rounding", between(modes))
            kept = held[:0]
        full = np.flatnonzero(modes.full[modes.closed])
        above = laws.force[full, 0] - p.force_limit
        value = np.r_[missing, d[kept], above]
        value_off = np.r_[missing_off, d_off[kept], force_off[full, 0] + 4 * ULP * np.abs(above)]
        units = np.r_[p.column_units, 1.0 / p.row_units[kept], np.ones(len(full))]
        A, A_size = _derivative(p, rows, kept, full, laws, sought)
        gap = (phi - printed) * p.row_units
        residual = max(np.abs(x).max(initial=0.0) for x in (value * units, d[held] / p.row_units[held], gap)) / p.scale
        if not balanced:
            nv = len(v)
            A, A_size, value, value_off, units = A[nv:, :nv], A_size[nv:, :nv], value[nv:], value_off[nv:], units[nv:]
        args = d, d_off, phi_off, laws, K_off, value, value_off, A, A_size, units, float(residual)
        return cls(p, modes, balanced, loose, rows, kept, full, v, phi, sought, *args)

    @cached_property
    def inverse(self) -> Array:
        """(n, k) about a right inverse of A. Raises `NotShown`."""
        p = self.p
        columns = p.column_units
        if self.balanced:
            columns = np.r_[columns, 1.0 / p.row_units[self.rows.unknown]]
            if self.sought.any():
                columns = np.r_[columns, 1.0 / np.abs(self.sought * p.column_units).max()]
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

    def _fails(self, rounding: bool) -> NotShown:
        said = f"Newton's test fails at a residual of {self.residual:.1e}"
        return NotShown(said if rounding else f"{said}, with {BITS} bits, too", between(self.modes), rounding)

    def box(self) -> Box:
        """A box about x0 in which an exact solution is. Raises `NotShown`."""
        if self.loose:
            raise self._fails(True)
        value = np.abs(self.value) + self.value_off
        C = self.inverse if value.any() else np.zeros(self.A.T.shape)
        p, laws, (M, size), nv = self.p, self.laws, self.p.rows, len(self.v)
        unit, Cv = _unit(p), np.abs(C[:nv])
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
                raise self._fails(True)
            grown = value + error @ radius
            if self.balanced:
                grown[:nv] += spread.T @ by_contact
            grown[len(grown) - len(self.full) :] += by_contact[self.full]
            if (grown <= radius).all():
                break
            radius = 1.2 * grown
        else:
            raise self._fails(True)
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


def _unit(p: Problem) -> float:
    """At most the relative error of a sum over rows or columns, of products of numbers that were rounded before."""
    return 4 * (sum(p.rows[0].shape) + 16) * ULP


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
    for M, K, more in zip(p.rows, (laws.K, np.abs(laws.K)), (sought, np.abs(sought)), strict=True):
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
    H = p.rows[0][held] * p.column_units / p.row_units[held, None]
    if len(H) <= H.shape[1]:
        if not len(H) or np.abs(np.linalg.qr(H.T, mode="r").diagonal()).min() > DEPENDENT:
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


def at_rest(p: Problem, held: Integers, v: Array) -> list[fmpq]:
    """Motions near v that keep all held rows at rest, exactly."""
    H = fmpq_mat([p.grasp.exact_rows[k] for k in held]).numer_denom()[0]
    basis, rank = H.nullspace()
    N = [
        [fmpq(basis[i, j], abs(max((basis[k, j] for k in range(len(v))), key=abs))) for j in range(rank)]
        for i in range(len(v))
    ]
    if not rank:
        return [fmpq(0)] * len(v)
    units = p.column_units[:, None]
    z = np.linalg.lstsq(np.array([[rounded(x) for x in row] for row in N]) / units, v / units[:, 0], rcond=None)[0]
    return [dot(row, rationals(z)) for row in N]


# --- what has to hold all over a box ---------------------------------------------------------------


def _margin(p: Problem, modes: Modes, box: Box) -> float:
    """The least that an inequality of the modes leaves, relative to the forces that act. Raises `NotShown`."""
    g, T = p.grasp, p.tangents
    d, d_off = box.d[T], box.d_off[T] + 8 * ULP * np.abs(box.d[T])
    c, c_off = box.phi[T], box.phi_off[T] + 8 * ULP * np.abs(box.phi[T])
    _, _, actuators, _, joints = g.parts
    length = lambda x: np.sqrt((x * x).sum(axis=-1)) * (1 + 8 * ULP)  # noqa: E731
    slides = length(d[:, 1:]) * (1 - 32 * ULP) - length(d_off[:, 1:])
    gap = p.cos * (d[:, 0] - d_off[:, 0]) + p.sin * np.maximum(slides, 0.0)
    presses = c[:, 0] - c_off[:, 0]
    inside = g.mu * presses * (1 - 8 * ULP) - length(c[:, 1:]) - length(c_off[:, 1:])
    cone = np.isin(modes.contact, (Contact.STICKS, Contact.RUBS)) & (g.mu > 0)  # that of LEANS is kept by its ratio
    below = p.force_limit - c[:, 0] - np.where(modes.closed, c_off[:, 0], 0.0)
    arms = p.row_units
    f, t = box.phi[actuators], box.d[actuators] * sense(p)
    f_off = box.phi_off[actuators] + 4 * ULP * np.abs(f)
    drive = 0.0 if p.drive is None else np.abs(p.drive) * box.magnitude_off
    beyond = sense(p) * (f - p.command) - (f_off + drive + 4 * ULP * np.abs(p.command)) * (f != p.command)
    turns = t - box.d_off[actuators]
    commanded = (g.command != 0) | g.tendon
    limited = p.limit - np.abs(f) - np.where(np.abs(f) == p.limit, box.phi_off[actuators], f_off)
    lo, hi = reaction_ends(g)
    rho, rho_off, q, q_off = box.phi[joints], box.phi_off[joints], box.d[joints], box.d_off[joints]
    at_rest = np.isin(modes.joint, (Part.RESTS, Part.LOW, Part.HIGH))
    carries = np.minimum(np.where(rho == lo, 0.0, rho - lo), np.where(rho == hi, 0.0, hi - rho)) - rho_off
    kind, unit_f, unit_t = modes.contact, arms[actuators], 1.0 / arms[actuators]
    all_of = (
        ("contact {}", "is not proved to be open", gap, kind == Contact.OPEN),
        ("contact {}", "is not proved to press", presses, modes.closed),
        ("contact {}", "is not proved to be inside its friction cone", inside, cone),
        ("contact {}", "is not proved to keep the force limit", below, modes.closed & ~modes.full),
        ("actuator {}", "is not proved to carry its command", beyond * unit_f, commanded & ~g.backdrivable),
        ("actuator {}", "is not proved to move in its sense", turns * unit_t, modes.actuator == Part.MOVES),
        ("actuator {}", "is not proved to keep its limit", limited * unit_f, np.isfinite(p.limit)),
        ("joint {}", "is not proved to carry its reaction", carries * arms[joints], at_rest),
        ("joint {}", "is not proved to close", (q - q_off) / arms[joints], modes.joint == Part.MOVES),
        ("joint {}", "is not proved to open", (-q - q_off) / arms[joints], modes.joint == Part.OPENS),
    )
    least = np.inf
    for name, fault, value, applies in all_of:
        value = np.where(applies, value, np.inf)
        k = int(np.argmin(value)) if len(value) else 0
        if len(value) and not value[k] >= 0:
            part = name.format(k)
            act = max(p.scale, float(np.abs(c).max()))
            raise NotShown(f"{_said(g, name, k)} {fault}: {value[k]:.2e} N", part, rounding=value[k] > -NEAR * act)
        least = min(least, float(value.min(initial=np.inf)))
    return least / max(p.scale, float(np.abs(c).max(initial=0.0)))


def _said(g: GraspData, name: str, k: int) -> str:
    names = {"actuator {}": g.actuators, "joint {}": g.joints}
    return f"{name.format('').strip()} '{names[name][k]}'" if name in names else name.format(k)


def _radius(p: Problem, x: State, box: Box) -> float:
    """[N] how far the box is from the floats at most. Raises `NotShown` if that is more than `NEAR`."""
    act = acting(p, x)
    motion = (np.abs(box.d - p.rows[0] @ x.motion) + box.d_off) / p.row_units
    force = (np.abs(box.phi - x.forces(p.grasp)) + box.phi_off) * p.row_units
    if not force.max() <= NEAR * act:
        where = row_name(p, int(np.argmax(force)))
        raise NotShown(f"{where}: the force of the state that is proved is {force.max():.1e} N from the printed one")
    return float(max(motion.max(), force.max()))


def row_name(p: Problem, k: int) -> str:
    """What a row of `Problem.rows` is about."""
    g = p.grasp
    contacts, soft, actuators, couplings, _ = g.parts
    if k < contacts.stop:
        return f"contact {k // 3}"
    if k < soft.stop:
        return f"torsion of contact {g.soft[k - soft.start]}"
    if k < actuators.stop:
        return f"actuator '{g.actuators[k - actuators.start]}'"
    return f"coupling {k - couplings.start}" if k < couplings.stop else f"joint '{g.joints[k - couplings.stop]}'"


# --- to 1e-9 of load and commands ------------------------------------------------------------------


def _within(p: Problem, modes: Modes, box: Box) -> Box:
    """With the unknown forces, which may be chosen, inside what the laws allow."""
    g, phi = p.grasp, box.phi.copy()
    for i in np.flatnonzero(np.isin(modes.contact, (Contact.STICKS, Contact.RUBS)) & (g.mu > 0)):
        n, *t = p.tangents[i]
        most = g.mu[i] * (phi[n] - box.phi_off[n]) * (1 - 64 * ULP)
        size = float(np.linalg.norm(phi[t]))
        if most >= 0 and size > most:
            phi[t] *= most / size * (1 - 64 * ULP)
    _, _, actuators, _, joints = g.parts
    rests, f = modes.actuator == Part.RESTS, phi[actuators]
    f = np.where(rests & (sense(p) * (f - p.command) < 0), p.command, f)
    free = rests | (modes.actuator == Part.LOCKED)
    phi[actuators] = np.where(free, np.clip(f, -p.limit, p.limit), f)
    lo, hi = reaction_ends(g)
    phi[joints] = np.where(modes.joint == Part.RESTS, np.clip(phi[joints], lo, hi), phi[joints])
    return replace(box, phi=phi)


def _within_slack(p: Problem, box: Box) -> None:
    """`NotShown` unless all of a box misses (1) and (2) by no more than `slack`."""
    g, (M, size), unit = p.grasp, p.rows, _unit(p)
    along = np.zeros(6) if p.along is None else p.magnitude * p.along
    load_size = np.abs(np.r_[np.abs(p.wrench) + np.abs(along), g.torque])
    missing = M.T @ box.phi + np.r_[p.load, g.torque]
    off = unit * (size.T @ np.abs(box.phi) + load_size) + size.T @ box.phi_off
    moment = missing[3:6] - np.cross(g.centroid, missing[:3])
    arm = np.abs(g.centroid)[[1, 2, 0, 2, 0, 1]].reshape(2, 3)
    wide = off[:3] + 4 * ULP * np.abs(missing[:3])
    moment_off = off[3:6] + arm[0] * wide[[2, 0, 1]] + arm[1] * wide[[1, 2, 0]]
    parts = {
        "(1), forces": np.linalg.norm(np.abs(missing[:3]) + off[:3]),
        "(1), torques": np.linalg.norm(np.abs(moment) + moment_off) / g.size,
    }
    torques = (np.abs(missing[6:]) + off[6:]) / g.joint_units
    parts |= {f"(2) of joint '{name}'": x for name, x in zip(g.joints, torques, strict=True)}
    for name, x in parts.items():
        if not x <= EPS * p.scale * (1 - 1e-6):
            raise NotShown(f"{name} is missed by {x / p.scale:.1e} of the load", rounding=bool(off.max() > 0))


# --- with as many digits as it takes ---------------------------------------------------------------


def refined(s: System) -> Box:
    """`System.box` in FLINT's balls, after Newton's method. Raises `NotShown`."""
    with ctx.workprec(BITS):
        return _Balls(s).box()


class _Balls:
    """A system in balls: the numbers of the grasp exactly, unknowns as lists of balls."""

    def __init__(self, s: System) -> None:
        self.s, p = s, s.p
        exact = [*p.grasp.exact_rows, [fmpq(0)] * len(s.v)]
        self.M = arb_mat([[arb(x) for x in row] for row in exact])
        self.unknown = np.flatnonzero(s.rows.unknown).tolist()
        self.sought = bool(s.sought.any() and s.balanced)
        along = np.zeros(6) if p.along is None else p.along
        start = arb(p.magnitude)
        self.load = [arb(w) for w in np.r_[p.wrench, p.grasp.torque]]
        self.along = [arb(w) for w in np.r_[along, np.zeros(p.grasp.l)]]
        self.start = [arb(x) for x in (*s.v, *(s.phi[self.unknown] if s.balanced else ()))]
        self.start += [start] * self.sought
        if s.loose:
            self.start = [arb(x) for x in at_rest(p, np.flatnonzero(s.rows.held), s.v)]
        self.magnitude = start

    def at(self, x: list[arb]) -> tuple[list[arb], list[arb], arb, list[list[arb]], list[arb]]:
        """Motions, forces, magnitude, derivatives K of all forces by all motions, and what the equations miss."""
        s, p, nv = self.s, self.s.p, len(self.s.v)
        size = len(s.phi)
        magnitude = x[-1] if self.sought else self.magnitude
        d = _column(self.M * arb_mat([[y] for y in x[:nv]]))
        phi = [arb(a) + magnitude * arb(b) for a, b in zip(s.rows.given, s.rows.drive, strict=True)]
        K = [[arb(0)] * size for _ in range(size)]
        for i, rows in enumerate(s.laws.rows.tolist()):
            _contact_law(s, i, [k for k in rows if k < size - 1], d, phi, K)
        for i, k in enumerate(self.unknown):
            phi[k] = x[nv + i] if s.balanced else arb(s.phi[k])
        missing = _column(self.M.transpose() * arb_mat([[y] for y in phi]))
        missing = [a + b + magnitude * c for a, b, c in zip(missing, self.load, self.along, strict=True)]
        above = [phi[s.laws.rows[i, 0]] - arb(p.force_limit) for i in s.full]
        value = [*(missing if s.balanced else []), *(d[k] for k in s.kept), *above]
        return d, phi, magnitude, K, value

    def derivative(self, K: list[list[arb]]) -> arb_mat:
        """(k, n) of the equations by the unknowns."""
        s, nv, M = self.s, len(self.s.v), self.M
        KM = arb_mat(K) * M
        out: list[list[arb]] = []
        if s.balanced:
            J = M.transpose() * KM
            drives = _column(M.transpose() * arb_mat([[arb(x)] for x in s.rows.drive]))
            for i in range(nv):
                last = [self.along[i] + drives[i]] if self.sought else []
                out.append([*(J[i, j] for j in range(nv)), *(M[k, i] for k in self.unknown), *last])
        rest = [arb(0)] * (len(self.start) - nv)
        out += [[*(M[k, j] for j in range(nv)), *rest] for k in s.kept.tolist()]
        out += [[*(KM[int(s.laws.rows[i, 0]), j] for j in range(nv)), *rest] for i in s.full]
        return arb_mat(out)

    def box(self) -> Box:
        s, x = self.s, self.start
        C, k = arb_mat(s.inverse.tolist()) if len(s.value) else None, len(s.value)
        radius = np.zeros(k)
        try:
            for _ in range(ROUNDS if k else 0):
                *_, K, value = self.at(x)
                step = _column(C * (self.derivative(K) * C).solve(arb_mat([[y] for y in value])))
                x = [(a - b).mid() for a, b in zip(x, step, strict=True)]
            if k:
                *_, K, value = self.at(x)
                C = (C * (self.derivative(K) * C).inv()).mid()
                missed = np.array([_most(y) for y in value])
                radius = 1.5 * missed
                for _ in range(ROUNDS):
                    away = _column(C * arb_mat([[arb(0, r)] for r in radius]))
                    wide = [a + b for a, b in zip(x, away, strict=True)]
                    error = self.derivative(self.at(wide)[3]) * C - arb_mat(k, k, 1)
                    grown = missed + np.array([[_most(y) for y in row] for row in error.table()]) @ radius * (1 + 1e-12)
                    if (grown <= radius).all():
                        break
                    radius = 1.5 * grown
                else:
                    raise s._fails(False)
                x = wide
        except ZeroDivisionError:
            raise s._fails(False) from None
        d, phi, magnitude, *_ = self.at(x)
        held = s.rows.held
        mid, off = _floats(d)
        return Box(
            np.where(held, 0.0, mid), np.where(held, 0.0, off), *_floats(phi), *(y[0] for y in _floats([magnitude]))
        )


def _contact_law(s: System, i: int, rows: list[int], d: list[arb], phi: list[arb], K: list[list[arb]]) -> None:
    """Put the force of the i-th contact that presses, by its motion, and its derivatives where they belong."""
    (n, *t), cos, sin, rub = rows, arb(s.p.cos), arb(s.p.sin), arb(s.laws.rub[i])
    smooth = bool(np.isfinite(s.laws.speed[i]))
    speed = sum((d[k] * d[k] for k in t), arb(0)).sqrt() if smooth else arb(0)
    if smooth and not speed > 0:
        raise ZeroDivisionError
    u = [d[k] / speed if smooth else arb(0) for k in t]
    by_d = [-cos, *(-sin * y for y in u)]
    phi[n] = -(cos * d[n] + sin * speed)
    for row, lean in zip(
        rows, [arb(1), *(arb(y) - rub * a for y, a in zip(s.laws.lean[i], u, strict=False))], strict=True
    ):
        phi[row] = lean * phi[n]
        for k, slope in zip(rows, by_d, strict=True):
            K[row][k] = lean * slope
    if rub != 0:
        for row, a in zip(t, u, strict=True):
            for k, b in zip(t, u, strict=True):
                K[row][k] -= rub * phi[n] / speed * (arb(int(row == k)) - a * b)


def _column(A: arb_mat) -> list[arb]:
    return [A[i, 0] for i in range(A.nrows())]


def _most(x: arb) -> float:
    """At least |x|; inf if nothing is known."""
    out = float(x.abs_upper()) if x.is_finite() else np.inf
    return out * (1 + 4 * ULP)


def _floats(values: list[arb]) -> tuple[Array, Array]:
    """Middles and radii."""
    mid = np.array([float(x.mid()) for x in values])
    off = np.array([float(x.rad()) for x in values])
    return mid, off * (1 + 4 * ULP) + 2 * ULP * np.abs(mid)
