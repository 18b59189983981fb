"""Floating-point numbers as the rational numbers that they are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from flint import fmpq

ZERO = fmpq(0)


def rational(x: float) -> fmpq:
    """A floating-point number as it is."""
    return fmpq(*float(x).as_integer_ratio())


def rationals(values: Iterable[float]) -> list[fmpq]:
    """Several."""
    return [rational(x) for x in values]


def cross(a: Sequence[fmpq], b: Sequence[fmpq]) -> list[fmpq]:
    """(3,) a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a: Iterable[fmpq], b: Iterable[fmpq]) -> fmpq:
    """a . b."""
    return sum((x * y for x, y in zip(a, b, strict=True)), ZERO)


def rounded(x: fmpq) -> float:
    """The nearest floating-point number; integers of any length."""
    return int(x.p) / int(x.q)
