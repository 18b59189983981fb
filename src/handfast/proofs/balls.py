"""As `newton`, in FLINT's balls: with the numbers of the grasp exactly, and as many digits as it takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

from handfast.proofs.fields import Array
from handfast.proofs.newton import BITS, NEWTON_ROUNDS, Box, System
from handfast.proofs.states import Numbers, sense
from handfast.proofs.tolerance import UNIT_ROUNDOFF

number: Numbers = np.frompyfunc(arb, 1, 1)
middle: Numbers = np.frompyfunc(arb.mid, 1, 1)
FAST = 1e-4  # by which each of Newton's steps with the inverse at the start has to reduce what is missed


def refined(s: System) -> Box:
    """`System.box` after Newton's method. Raises `NotShown`."""
    with _enough_digits(s):
        return Balls(s).box()


def solution(s: System) -> tuple[Array, Array, float]:
    """Motions (6 + l,), forces (N + 1,) and magnitude after Newton's method, rounded. Raises `NotShown`."""
    with _enough_digits(s):
        balls = Balls(s)
        x = balls.solved()
        phi = balls.at(x)[1]
        magnitude = float(x[-1].mid()) if s.sought else s.p.magnitude
        return _floats(x[: len(s.v)])[0], _floats(phi)[0], magnitude


@contextmanager
def _enough_digits(s: System) -> Iterator[None]:
    """Balls of so many bits; `NotShown` where one of them may be a direction of sliding of length 0."""
    try:
        with ctx.workprec(BITS):
            yield
    except ZeroDivisionError:
        raise s.fails(False) from None


class Balls:
    """A system in balls: the numbers of the grasp exactly, unknowns as arrays of balls."""

    def __init__(self, s: System) -> None:
        self.s, self.M = s, number(s.p.grasp.exact_table)
        self.along = number(np.zeros(6) if s.p.along is None else s.p.along)
        self.start = number(np.concatenate([s.v, s.phi[s.of_modes.unknown], [s.p.magnitude] * s.sought]))

    def at(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Motions, forces, derivatives of each pressing contact's forces by its motions, what is missed."""
        d, phi, laws, value = self.s.of_modes.at(self.M, x, number)
        if not (laws.speed > 0).all():
            raise ZeroDivisionError("a direction of sliding may be any")
        return d, phi, laws.K, value[self.s.used]

    def derivative(self, K: Array) -> arb_mat:
        """(k, n) of the equations by the unknowns."""
        return arb_mat(self.s.of_modes.derivative(self.M, K, self.along)[self.s.used].tolist())

    def solved(self) -> Array:
        """Unknowns after Newton's method. Raises `NotShown`, or ZeroDivisionError."""
        s, x = self.s, self.start
        if not len(s.value):
            return x
        C = number(s.inverse)
        with suppress(ZeroDivisionError):
            near = self._nearer(C)
            if near is not None:
                return near
        for _ in range(NEWTON_ROUNDS):
            *_, K, value = self.at(x)
            step = (self.derivative(K) * arb_mat(C.tolist())).solve(arb_mat(value[:, None].tolist()))
            x = middle(x - C @ np.array(step.entries()))
        return x

    def _nearer(self, C: Array) -> Array | None:
        """Unknowns after steps with one inverse C of the derivative; None where one of them brings little."""
        x, before = self.start, np.inf
        for _ in range(NEWTON_ROUNDS):
            *_, value = self.at(x)
            missed = float((most(value) * self.s.units).max())
            if not missed <= FAST * before:
                return None
            x, before = middle(x - C @ value), missed
        return x

    def box(self) -> Box:
        """A box about the solved unknowns in which an exact solution is. Raises `NotShown`."""
        s, x = self.s, self.solved()
        if len(s.value):
            x = self._contained(x)
        d, phi, *_ = self.at(x)
        rows, motion, (mid, off), forces = s.of_modes.rows, _floats(x[: len(s.v)]), _floats(d), _floats(phi)
        (shift,), (shift_off,) = _floats(x[-1:]) if s.sought else _floats(number([s.p.magnitude]))
        mid, off = np.where(rows.held, rows.at, mid), np.where(rows.held, 2 * UNIT_ROUNDOFF * np.abs(rows.at), off)
        beyond, beyond_off = _floats((phi[s.p.grasp.parts[2]] - number(s.p.command)) * number(sense(s.p)))
        return Box(*motion, mid, off, *forces, shift, shift_off, beyond - beyond_off)

    def _contained(self, x: Array) -> Array:
        """Balls about x that Newton's test keeps. Raises `NotShown`."""
        *_, K, value = self.at(x)
        C, missed = arb_mat(self.s.inverse.tolist()), most(value)
        wide = self._kept(x, C, missed, 1)
        with suppress(ZeroDivisionError):
            if wide is None:
                wide = self._kept(x, (C * (self.derivative(K) * C).inv()).mid(), missed, NEWTON_ROUNDS)
        if wide is None:
            raise self.s.fails(False)
        return wide

    def _kept(self, x: Array, C: arb_mat, missed: Array, rounds: int) -> Array | None:
        """Balls about x, with C about a right inverse of the derivative; None where the test keeps none."""
        radius, one = 1.5 * missed, arb_mat(len(missed), len(missed), 1)
        for _ in range(rounds):
            away = C * arb_mat([[arb(0, r)] for r in radius])
            wide = x + np.array(away.entries())
            try:
                error = self.derivative(self.at(wide)[2]) * C - one
            except ZeroDivisionError:  # a direction of sliding may be any
                return None
            grown = missed + most(np.array(error.tolist())) @ radius * (1 + 1e-12)
            if (grown <= radius).all():
                return wide
            radius = 1.5 * grown
        return None


def most(x: Any) -> Array:
    """At least |x| of balls, as floats; inf where nothing is known."""
    known = [float(y.abs_upper()) if y.is_finite() else np.inf for y in x.ravel()]
    return np.array(known).reshape(x.shape) * (1 + 4 * UNIT_ROUNDOFF)


def _floats(values: Any) -> tuple[Array, Array]:
    """Middles and radii."""
    mid = np.array([float(x.mid()) for x in values])
    off = np.array([float(x.rad()) for x in values])
    return mid, off * (1 + 4 * UNIT_ROUNDOFF) + 2 * UNIT_ROUNDOFF * np.abs(mid)
