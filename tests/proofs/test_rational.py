"""Floating-point numbers as rational numbers."""

from __future__ import annotations

import math

import pytest
from flint import fmpq

from handfast.proofs.rational import ZERO, cross, dot, rational, rationals, rounded


def test_numbers_are_what_they_are() -> None:
    assert rational(0.75) == fmpq(3, 4)
    assert rational(-2.5) == fmpq(-5, 2)
    assert rational(3) == fmpq(3)
    assert rational(0.0) == ZERO == fmpq(0)
    # 0.1 in binary: 0x1.999999999999ap-4 = 7205759403792794 / 2^56, which is 3602879701896397 / 2^55
    assert rational(0.1) == fmpq(3602879701896397, 2**55)
    assert rational(0.1) != fmpq(1, 10)
    assert rational(5e-324) == fmpq(1, 2**1074)
    assert rational(1e308) == fmpq(int(1e308))


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan])
def test_what_is_not_finite_has_none(wrong: float) -> None:
    with pytest.raises((OverflowError, ValueError), match="integer ratio"):
        rational(wrong)


def test_several() -> None:
    assert rationals([0.5, -0.25]) == [fmpq(1, 2), fmpq(-1, 4)]
    assert rationals(()) == []


def test_products_by_hand() -> None:
    # (1, 2, 3) x (5, 7, 11) = (2 11 - 3 7, 3 5 - 1 11, 1 7 - 2 5) = (1, 4, -3); scalar 5 + 14 + 33 = 52
    a, b = rationals([1, 2, 3]), rationals([5, 7, 11])
    assert cross(a, b) == [1, 4, -3]
    assert cross(b, a) == [-1, -4, 3]
    assert dot(a, b) == 52
    assert isinstance(dot(a, b), fmpq)
    assert dot([], []) == ZERO
    with pytest.raises(ValueError, match="zip"):
        dot(a, b[:2])


def test_rounding_goes_to_the_nearest() -> None:
    assert rounded(fmpq(1, 10)) == 0.1
    assert rounded(fmpq(-1, 3)) == -1 / 3
    # halfway between 1 and 1 + 2^-52: to even; a little more: up
    assert rounded(fmpq(2**53 + 1, 2**53)) == 1.0
    assert rounded(fmpq(2**53 + 1, 2**53) + fmpq(1, 2**200)) == 1 + 2.0**-52
    # integers far beyond the range of floating-point numbers: 3 10^400 / (4 10^400 - 1) is 0.75 but for rounding
    assert rounded(fmpq(3 * 10**400, 4 * 10**400 - 1)) == 0.75
