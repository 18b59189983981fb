"""As `newton`, in FLINT's balls: with the numbers of the grasp exactly, and as many digits as it takes."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from flint import arb, arb_mat, ctx

from handfast.proofs.fields import Array
from handfast.proofs.newton import BITS, ROUNDS, Box, System
from handfast.proofs.states import ULP

FAST = 1e-4  # by which each of Newton's steps with the inverse at the start has to reduce what is missed


def refined(s: System) -> Box:
    """`System.box` after Newton's method. Raises `NotShown`."""
    with ctx.workprec(BITS):
        return Balls(s).box()


def solution(s: System) -> tuple[Array, Array, float]:
    """Motions (6 + l,), forces (N + 1,) and magnitude after Newton's method, rounded. Raises `NotShown`."""
    with ctx.workprec(BITS):
        balls = Balls(s)
        x = balls.solved()
        _, phi, magnitude, *_ = balls.at(x)
        return _floats(x[: len(s.v)])[0], _floats(phi)[0], float(magnitude.mid())


class Balls:
    """A system in balls: the numbers of the grasp exactly, unknowns as lists of balls."""

    def __init__(self, s: System) -> None:
        self.s, p = s, s.p
        self.M = arb_mat([[arb(x) for x in row] for row in p.grasp.exact_rows])
        self.unknown = np.flatnonzero(s.rows.unknown).tolist()
        self.rows = [[k for k in rows if k < len(s.phi) - 1] for rows in s.laws.rows.tolist()]
        self.M_of = [arb_mat([[arb(x) for x in p.grasp.exact_rows[k]] for k in rows]) for rows in self.rows]
        self.sought = bool(s.sought.any())
        along = np.zeros(6) if p.along is None else p.along
        start = arb(p.magnitude)
        self.load = [arb(w) for w in np.r_[p.wrench, p.grasp.torque]]
        self.along = [arb(w) for w in np.r_[along, np.zeros(p.grasp.l)]]
        self.start = [arb(x) for x in (*s.v, *s.phi[self.unknown])]
        self.start += [start] * self.sought
        self.magnitude = start

    def at(self, x: list[arb]) -> tuple[list[arb], list[arb], arb, list[arb_mat], list[arb]]:
        """Motions, forces, magnitude, derivatives of each pressing contact's forces by its motions, what is missed."""
        s, p, nv = self.s, self.s.p, len(self.s.v)
        magnitude = x[-1] if self.sought else self.magnitude
        d = _column(self.M * arb_mat([[y] for y in x[:nv]]))
        phi = [arb(x) for x in s.rows.given]
        K = [_contact_law(s, i, rows, d, phi) for i, rows in enumerate(self.rows)]
        for i, k in enumerate(self.unknown):
            phi[k] = x[nv + i]
        missing = _column(self.M.transpose() * arb_mat([[y] for y in phi]))
        missing = [a + b + magnitude * c for a, b, c in zip(missing, self.load, self.along, strict=True)]
        above = [phi[s.laws.rows[i, 0]] - arb(p.force_limit) for i in s.full]
        at = s.rows.exact
        value = [*missing, *(d[k] - arb(at[k]) if k in at else d[k] for k in s.kept.tolist()), *above]
        return d, phi, magnitude, K, [value[i] for i in s.used]

    def derivative(self, K: list[arb_mat]) -> arb_mat:
        """(k, n) of the equations by the unknowns."""
        s, nv, M = self.s, len(self.s.v), self.M
        KM = [of_contact * own for of_contact, own in zip(K, self.M_of, strict=True)]
        out: list[list[arb]] = []
        J = _stacked(self.M_of, nv).transpose() * _stacked(KM, nv)
        for i in range(nv):
            last = [self.along[i]] if self.sought else []
            out.append([*(J[i, j] for j in range(nv)), *(M[k, i] for k in self.unknown), *last])
        rest = [arb(0)] * (len(self.start) - nv)
        out += [[*(M[k, j] for j in range(nv)), *rest] for k in s.kept.tolist()]
        out += [[*(KM[i][0, j] for j in range(nv)), *rest] for i in s.full.tolist()]
        return arb_mat([out[i] for i in s.used])

    def solved(self) -> list[arb]:
        """Unknowns after Newton's method. Raises `NotShown`."""
        s, x = self.s, self.start
        if not len(s.value):
            return x
        C = arb_mat(s.inverse.tolist())
        with suppress(ZeroDivisionError):
            near = self._nearer(C)
            if near is not None:
                return near
        try:
            for _ in range(ROUNDS):
                *_, K, value = self.at(x)
                step = _column(C * (self.derivative(K) * C).solve(arb_mat([[y] for y in value])))
                x = [(a - b).mid() for a, b in zip(x, step, strict=True)]
        except ZeroDivisionError:
            raise s.fails(False) from None
        return x

    def _nearer(self, C: arb_mat) -> list[arb] | None:
        """Unknowns after steps with one inverse C of the derivative; None where one of them brings little."""
        x, units, before = self.start, self.s.units.tolist(), np.inf
        for _ in range(ROUNDS):
            *_, value = self.at(x)
            missed = max(_most(y) * unit for y, unit in zip(value, units, strict=True))
            if not missed <= FAST * before:
                return None
            x = [(a - b).mid() for a, b in zip(x, _column(C * arb_mat([[y] for y in value])), strict=True)]
            before = missed
        return x

    def box(self) -> Box:
        """A box about the solved unknowns in which an exact solution is. Raises `NotShown`."""
        s, x = self.s, self.solved()
        if len(s.value):
            x = self._contained(x)
        d, phi, magnitude, *_ = self.at(x)
        held, (motion, (mid, off), forces) = s.rows.held, (_floats(y) for y in (x[: len(s.v)], d, phi))
        (shift,), (shift_off,) = _floats([magnitude])
        at, at_off = s.rows.at, 2 * ULP * np.abs(s.rows.at)
        mid, off = np.where(held, at, mid), np.where(held, at_off, off)
        return Box(*motion, mid, off, *forces, shift, shift_off)

    def _contained(self, x: list[arb]) -> list[arb]:
        """Balls about x that Newton's test keeps. Raises `NotShown`."""
        *_, K, value = self.at(x)
        C, missed = arb_mat(self.s.inverse.tolist()), np.array([_most(y) for y in value])
        wide = self._kept(x, C, missed, 1)
        with suppress(ZeroDivisionError):
            wide = wide or self._kept(x, (C * (self.derivative(K) * C).inv()).mid(), missed, ROUNDS)
        if wide is None:
            raise self.s.fails(False)
        return wide

    def _kept(self, x: list[arb], C: arb_mat, missed: Array, rounds: int) -> list[arb] | None:
        """Balls about x, with C about a right inverse of the derivative; None where the test keeps none."""
        radius, one = 1.5 * missed, arb_mat(len(missed), len(missed), 1)
        for _ in range(rounds):
            away = _column(C * arb_mat([[arb(0, r)] for r in radius]))
            wide = [a + b for a, b in zip(x, away, strict=True)]
            try:
                error = self.derivative(self.at(wide)[3]) * C - one
            except ZeroDivisionError:  # a direction of sliding may be any
                return None
            grown = missed + np.array([[_most(y) for y in row] for row in error.table()]) @ radius * (1 + 1e-12)
            if (grown <= radius).all():
                return wide
            radius = 1.5 * grown
        return None


def _stacked(parts: list[arb_mat], width: int) -> arb_mat:
    """Matrices one below the other."""
    rows = [row for part in parts for row in part.table()]
    return arb_mat(rows) if rows else arb_mat(0, width)


def _contact_law(s: System, i: int, rows: list[int], d: list[arb], phi: list[arb]) -> arb_mat:
    """Put the force of the i-th contact that presses, by its motion, where it belongs; its derivatives."""
    (n, *t), cos, sin, rub = rows, arb(s.p.cos), arb(s.p.sin), arb(s.laws.rub[i])
    smooth = bool(np.isfinite(s.laws.speed[i]))
    speed = sum((d[k] * d[k] for k in t), arb(0)).sqrt() if smooth else arb(0)
    if smooth and not speed > 0:
        raise ZeroDivisionError
    u = [d[k] / speed if smooth else arb(0) for k in t]
    by_d = [-cos, *(-sin * y for y in u)]
    phi[n] = -(arb(s.p.grasp.gaps[n // 3]) + cos * d[n] + sin * speed)
    leans = [arb(1), *(arb(y) - rub * a for y, a in zip(s.laws.lean[i], u, strict=False))]
    for row, lean in zip(rows, leans, strict=True):
        phi[row] = lean * phi[n]
    K = arb_mat([[lean * slope for slope in by_d] for lean in leans])
    if rub != 0:
        turned = rub * phi[n] / speed
        for j, a in enumerate(u, start=1):
            for k, b in enumerate(u, start=1):
                K[j, k] -= turned * (arb(int(j == k)) - a * b)
    return K


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
