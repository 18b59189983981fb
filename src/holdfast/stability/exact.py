"""From an approximate solution to an exact one: fix what each contact does, then Newton on (1)-(8).

A relaxation's solution says which contacts are open, stick or slide and which actuators move. With
these modes fixed the model is a small square system; minimum-norm Newton steps solve it to rounding.
If the result violates an inequality of its mode, that contact or actuator changes its mode, in two ways
tried in turn: to the border between the two modes (the inequality becomes an equality, right where a
maximum sits on a border), or across it (a sticking contact slides, right where everything is fixed).
`stability/model` judges the result: nothing is a witness before `residuals` says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from holdfast.mechanism import Array, Mask
from holdfast.stability.problem import Problem

CONVERGED = 1e-13  # scaled residual at which Newton stops
GOOD = 1e-11  # scaled residual that is accepted when it cannot be lowered further
ITERATIONS = 30
HALVINGS = 8
REPAIRS = 6  # inequalities turned into equalities before giving up
STILL = 1e-9  # (scaled) sliding less than this has no direction yet
SLACK = 1e-11  # an inequality may be missed by this much (scaled); the judge allows 1e-9


class Touch(Enum):
    """What a contact does."""

    OPEN = auto()  # c = 0, d^_n >= 0
    GRAZE = auto()  # c = 0, d^_n = 0
    STICK = auto()  # c_n = -d_n, d_t = 0, inside the cone
    EDGE = auto()  # sticks on the border of the cone
    SLIDE = auto()  # c_n = -d^_n, friction against the motion
    FREE = auto()  # closed, any friction in the cone: the model without the dissipation principle
    RIM = auto()  # the same, on the border of the cone


class Motor(Enum):
    """What an actuator does."""

    LOCKED = auto()  # t = 0, f free
    HELD = auto()  # commanded, t = 0, f >= f_c
    TURNS = auto()  # commanded, f = f_c, t >= 0
    BALANCED = auto()  # t = 0 and f = f_c
    DRIVEN = auto()  # its command is what is sought: t >= 0, f >= 0 is the command
    RELEASED = auto()  # the same with f = 0


@dataclass(frozen=True, eq=False)
class Load:
    """The right-hand side, affine in one scalar: w = w_a + sigma w_b, f_c = f_a + sigma f_b."""

    w_a: Array
    w_b: Array
    f_a: Array
    f_b: Array
    free: bool  # sigma is unknown; otherwise it is held


@dataclass(frozen=True, eq=False)
class Point:
    """Scaled unknowns (shapes as in `Problem`) and the scalar sigma of the load."""

    r: Array
    q: Array
    c: Array
    f: Array
    coupling: Array
    sigma: float = 0.0

    def flat(self) -> Array:
        return np.concatenate([self.r, self.q, self.c, self.f, self.coupling, [self.sigma]])


@dataclass(frozen=True)
class Modes:
    """One `Touch` per contact and one `Motor` per actuator."""

    touch: tuple[Touch, ...]
    motor: tuple[Motor, ...]
    full: frozenset[int] = frozenset()  # contacts at the largest normal force
    strained: frozenset[int] = frozenset()  # actuators at their torque limit


def read_modes(p: Problem, x: Point, *, driven: Mask | None = None, tol: float = 1e-6) -> Modes:
    """The modes that an approximate point shows."""
    d = p.relative_motion(x.r, x.q)
    c = x.c.reshape(-1, 3)
    touch = []
    for ci, di in zip(c, d, strict=True):
        if ci[0] <= tol:
            touch.append(Touch.OPEN)
        elif not p.mdp:
            touch.append(Touch.FREE)
        else:
            touch.append(Touch.SLIDE if np.linalg.norm(di[1:]) > tol else Touch.STICK)
    t = p.R @ x.q
    motor = []
    for i in range(len(t)):
        if driven is not None and driven[i]:
            motor.append(Motor.DRIVEN if t[i] > tol else Motor.LOCKED)
        elif not p.moves[i]:
            motor.append(Motor.LOCKED)
        else:
            motor.append(Motor.TURNS if t[i] > tol else Motor.HELD)
    return Modes(tuple(touch), tuple(motor))


def solve(p: Problem, load: Load, start: Point, modes: Modes) -> Point | None:
    """A point that satisfies the model in the given modes, or modes next to them; None if not found."""
    for across in (False, True):
        x, now = start, modes
        for _ in range(REPAIRS):
            found = _newton(p, load, x, now)
            if found is None:
                break
            x, before = found, now
            now = _repair(p, load, x, before, across)
            if now == before:
                return x
    return None


# --- the system of equations in fixed modes --------------------------------------------------------


def _system(p: Problem, load: Load, x: Point, modes: Modes) -> tuple[Array, Array]:
    """Residual and Jacobian of all equalities, unknowns ordered as in `Point.flat`."""
    m, l, a, k = p.sizes
    n = 6 + l + 3 * m + a + k + 1
    R0, Q0, C0, F0, L0 = 0, 6, 6 + l, 6 + l + 3 * m, 6 + l + 3 * m + a
    rows: list[Array] = []
    rhs: list[float] = []

    def add(value: float, *blocks: tuple[int, Array]) -> None:
        row = np.zeros(n)
        for start, coefficients in blocks:
            row[start : start + len(coefficients)] += coefficients
        rows.append(row)
        rhs.append(value)

    balance = p.G @ x.c + load.w_a + x.sigma * load.w_b
    for i in range(6):  # (1)
        add(balance[i], (C0, p.G[i]), (n - 1, load.w_b[i : i + 1]))
    torque = p.J.T @ x.c - p.R.T @ x.f - p.A.T @ x.coupling
    for j in range(l):  # (2)
        add(torque[j], (C0, p.J[:, j]), (F0, -p.R[:, j]), (L0, -p.A[:, j]))
    for i in range(k):
        add(float(p.A[i] @ x.q), (Q0, p.A[i]))

    d = p.relative_motion(x.r, x.q)
    c = x.c.reshape(-1, 3)
    cos, sin = np.cos(p.eta), np.sin(p.eta)
    for i, mode in enumerate(modes.touch):
        rows_d = np.hstack([p.G[:, 3 * i : 3 * i + 3].T, -p.J[3 * i : 3 * i + 3]])  # d_i over (r, q)
        v = float(np.linalg.norm(d[i, 1:]))
        u = d[i, 1:] / v if v > 0 else np.zeros(2)
        dn = d[i, 0] * cos + v * sin
        grad_dn = rows_d[0] * cos + (u @ rows_d[1:]) * sin
        e = np.eye(3)
        if mode in (Touch.OPEN, Touch.GRAZE):
            for b in range(3):
                add(c[i, b], (C0 + 3 * i, e[b]))
            if mode is Touch.GRAZE:
                add(dn, (R0, grad_dn))
            continue
        if mode in (Touch.STICK, Touch.EDGE):
            add(c[i, 0] + d[i, 0] * cos, (C0 + 3 * i, e[0]), (R0, rows_d[0] * cos))  # (4), d_t = 0
            add(d[i, 1], (R0, rows_d[1]))
            add(d[i, 2], (R0, rows_d[2]))
        else:
            add(c[i, 0] + dn, (C0 + 3 * i, e[0]), (R0, grad_dn))  # (4), (17)
        if mode in (Touch.EDGE, Touch.RIM):
            ct = float(np.linalg.norm(c[i, 1:]))
            grad = np.r_[-p.mu[i], c[i, 1:] / ct] if ct > 0 else np.r_[-p.mu[i], 0.0, 0.0]
            add(ct - p.mu[i] * c[i, 0], (C0 + 3 * i, grad))  # (5) with equality
        ct = float(np.linalg.norm(c[i, 1:]))
        if mode is Touch.SLIDE and v <= STILL and ct > 0:  # not yet sliding: friction keeps its direction
            for b in (0, 1):
                along = c[i, 1 + b] / ct
                add(c[i, 1 + b] - p.mu[i] * c[i, 0] * along, (C0 + 3 * i, np.r_[-p.mu[i] * along, b == 0, b == 1]))
        elif mode is Touch.SLIDE:  # (7): c_t |d_t| + mu c_n d_t = 0, divided by |d_t|
            scale = max(v, 1e-300)
            for b in (0, 1):
                value = c[i, 1 + b] * v + p.mu[i] * c[i, 0] * d[i, 1 + b]
                grad_c = np.r_[p.mu[i] * d[i, 1 + b], v * (b == 0), v * (b == 1)]
                grad_d = c[i, 1 + b] * (u @ rows_d[1:]) + p.mu[i] * c[i, 0] * rows_d[1 + b]
                add(value / scale, (C0 + 3 * i, grad_c / scale), (R0, grad_d / scale))

    t = p.R @ x.q
    f_c = load.f_a + x.sigma * load.f_b
    for i, motor in enumerate(modes.motor):  # (8)
        one = np.zeros(a)
        one[i] = 1.0
        if motor in (Motor.LOCKED, Motor.HELD, Motor.BALANCED):
            add(float(t[i]), (Q0, p.R[i]))
        if motor in (Motor.TURNS, Motor.BALANCED):
            add(float(x.f[i] - f_c[i]), (F0, one), (n - 1, -load.f_b[i : i + 1]))
        if motor is Motor.RELEASED:
            add(float(x.f[i]), (F0, one))
    for i in modes.full:
        add(float(c[i, 0] - p.cn_max), (C0 + 3 * i, np.ones(1)))
    for i in modes.strained:
        side = np.sign(x.f[i])
        add(float(side * x.f[i] - p.f_max[i]), (F0 + i, np.array([side])))
    J = np.array(rows)
    if not load.free:
        J[:, -1] = 0.0
    return np.array(rhs), J


def _newton(p: Problem, load: Load, x: Point, modes: Modes) -> Point | None:
    """Minimum-norm Newton steps, halved while they make the residual worse."""
    g, J = _system(p, load, x, modes)
    error = float(np.abs(g).max())
    for _ in range(ITERATIONS):
        if error <= CONVERGED:
            return x
        step = np.linalg.lstsq(J, -g, rcond=1e-11)[0]
        if not np.isfinite(step).all():
            return None
        for halving in range(HALVINGS):
            nearer = _moved(p, x, step / 2**halving)
            g_new, J_new = _system(p, load, nearer, modes)
            new = float(np.abs(g_new).max())
            if new < error:
                break
        else:
            break  # no progress: as exact as the numbers allow, or stuck
        x, g, J, error = nearer, g_new, J_new, new
    return x if error <= GOOD else None


def _moved(p: Problem, x: Point, step: Array) -> Point:
    _, l, a, k = p.sizes
    r, q, c, f, coupling, sigma = np.split(x.flat() + step, np.cumsum([6, l, 3 * len(p.mu), a, k]))
    return Point(r, q, c, f, coupling, float(sigma[0]))


def _repair(p: Problem, load: Load, x: Point, modes: Modes, across: bool) -> Modes:
    """The same modes, changed where an inequality is violated; equal to `modes` if all hold."""
    d = p.relative_motion(x.r, x.q)
    c = x.c.reshape(-1, 3)
    touch = list(modes.touch)
    for i, mode in enumerate(touch):
        sliding = float(np.linalg.norm(d[i, 1:]))
        dn = d[i, 0] * np.cos(p.eta) + sliding * np.sin(p.eta)
        excess = np.linalg.norm(c[i, 1:]) - p.mu[i] * c[i, 0]
        closed = Touch.FREE if not p.mdp else Touch.SLIDE if sliding > STILL else Touch.STICK
        if mode is Touch.OPEN and dn < -SLACK:
            touch[i] = closed if across else Touch.GRAZE
        elif mode not in (Touch.OPEN, Touch.GRAZE) and c[i, 0] < -SLACK:
            touch[i] = Touch.OPEN
        elif mode is Touch.STICK and excess > SLACK:
            touch[i] = Touch.SLIDE if across else Touch.EDGE
        elif mode is Touch.FREE and excess > SLACK:
            touch[i] = Touch.RIM
    t = p.R @ x.q
    excess_f = x.f - (load.f_a + x.sigma * load.f_b)
    motor = list(modes.motor)
    for i, mode_f in enumerate(motor):
        if mode_f is Motor.TURNS and t[i] < -SLACK:
            motor[i] = Motor.HELD if across else Motor.BALANCED
        elif mode_f is Motor.HELD and excess_f[i] < -SLACK:
            motor[i] = Motor.TURNS if across else Motor.BALANCED
        elif mode_f is Motor.DRIVEN and t[i] < -SLACK:
            motor[i] = Motor.LOCKED
        elif mode_f is Motor.DRIVEN and x.f[i] < -SLACK:
            motor[i] = Motor.RELEASED
    return Modes(
        tuple(touch),
        tuple(motor),
        modes.full | {i for i in range(len(c)) if c[i, 0] > p.cn_max + SLACK},
        modes.strained | {i for i in range(len(t)) if abs(x.f[i]) > p.f_max[i] + SLACK},
    )
