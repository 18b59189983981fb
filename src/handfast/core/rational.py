"""Floating-point numbers as the rational numbers that they are."""

from __future__ import annotations

from collections.abc import Sequence

from flint import fmpq


def rational(x: float) -> fmpq:
    """A floating-point number as it is."""
    return fmpq(*float(x).as_integer_ratio())


def rational_cross(a: Sequence[fmpq], b: Sequence[fmpq]) -> list[fmpq]:
    """The cross product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def rounded(x: fmpq) -> float:
    """The nearest floating-point number; integers of any length."""
    return int(x.p) / int(x.q)
