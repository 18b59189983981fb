"""Newton's method in balls: never less than they are; of x^2 = c, by hand."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat, ctx

from handfast.proofs import balls
from handfast.proofs.balls import Balls, most
from handfast.proofs.newton import NotShown


def roots(
    starts: Sequence[float],
    squares: Sequence[float],
    inverse: Sequence[float] | None = None,
    units: Sequence[float] = (1.0,),
    sought: bool = False,
) -> Any:
    """x^2 = c of each unknown, whose speeds are the unknowns; with sought the last one is the magnitude."""
    x, n = np.array(starts), len(starts)

    def at(M: Any, y: Any, number: Any) -> Any:
        return M @ y, 3 * y, SimpleNamespace(speed=y, K=y), y * y - number(np.array(squares))

    def derivative(M: Any, K: Any, along: Any) -> Any:
        assert along.tolist() == [0] * 6
        return M * (2 * K)

    of_modes = SimpleNamespace(
        unknown=[], at=at, derivative=derivative,
        rows=SimpleNamespace(held=np.zeros(n, dtype=bool), at=np.zeros(n)),
    )  # fmt: skip
    g = SimpleNamespace(exact_table=np.eye(n), parts=(None, None, slice(0, 1)), command=np.array([18**0.5]))
    p = SimpleNamespace(grasp=g, command=g.command, along=None, magnitude=x[-1] if sought else 7.0)
    return SimpleNamespace(
        p=p, of_modes=of_modes, v=x[: n - sought], phi=np.zeros(n), value=x, used=slice(None), units=np.array(units),
        inverse=np.diag(0.5 / x if inverse is None else inverse), sought=sought,
        fails=lambda rounding: NotShown("none", rounding=rounding),
    )  # fmt: skip


def test_sizes_of_balls_are_rounded_up() -> None:
    with ctx.workprec(320):
        many = [arb(sign * k, radius) / 7 for k in range(1, 60) for sign in (1, -1) for radius in (0, 1e-30, 0.1)]
        bounds = most(np.array(many, dtype=object).reshape(-1, 6))
        assert bounds.shape == (59, 6)
        for x, bound in zip(many, bounds.ravel().tolist(), strict=True):
            assert arb(bound) >= abs(x)
            assert bound <= float(x.abs_upper()) * (1 + 1e-14)
        assert most(np.array([arb("nan"), arb("inf")], dtype=object)).tolist() == [np.inf, np.inf]


@pytest.mark.parametrize("inverse", [None, [10.0], [0.01]], ids=["near", "beyond where nothing slides", "slow"])
@pytest.mark.parametrize("sought", [False, True])
def test_a_box_holds_the_root_and_little_more(inverse: list[float] | None, sought: bool) -> None:
    n = 3 if sought else 1
    s = roots([1.5] * n, [2.0, 2.0, 3.0][:n], inverse and inverse * n, sought=sought)
    box = balls.refined(s)
    pairs = [(box.v[0], box.v_off[0], 1, 2), (box.d[0], box.d_off[0], 1, 2), (box.phi[0], box.phi_off[0], 9, 2)]
    pairs += [(box.magnitude, box.magnitude_off, 1, 3)] if sought else []
    for mid, off, times, square in pairs:
        low, high = Fraction(mid) - Fraction(off), Fraction(mid) + Fraction(off)
        assert low**2 < times * square < high**2
        assert 2 * mid * 2.0**-53 <= off <= 2.1 * mid * 2.0**-53
    v, phi, magnitude = balls.solution(s)
    assert (v[0], phi[0]) == (pytest.approx(2**0.5, rel=1e-15), pytest.approx(3 * 2**0.5, rel=1e-15))
    assert magnitude == pytest.approx(3**0.5 if sought else 7.0, rel=1e-15)
    assert box.magnitude == magnitude


def test_what_a_motor_carries_beyond_its_command_is_told_by_more_digits_than_floats_have() -> None:
    """3 times the root of 2, which is no float: the one before it is less, the one after it more."""
    near = 18**0.5
    for command in (near, np.nextafter(near, 0), np.nextafter(near, 9)):
        s = roots([1.5], [2.0])
        s.p.command = s.p.grasp.command = np.array([command])
        (beyond,) = balls.refined(s).carried
        assert (beyond > 0) == (Fraction(float(command)) ** 2 < 18)
        assert 0 < abs(beyond) < 2e-15
    s.p.command = s.p.grasp.command = np.array([-near])  # in the other sense it carries much less
    assert balls.refined(s).carried == pytest.approx([-2 * near])


def test_a_box_is_as_wide_as_newtons_test_needs() -> None:
    """From 40 the steps come to 1.69 only."""
    box = balls.refined(roots([40.0], [2.0]))
    assert box.v[0] - box.v_off[0] < 2**0.5 < box.v[0] - 0.2
    assert box.d_off[0] == pytest.approx(box.v_off[0], rel=1e-8)


def test_middles_and_radii_are_rounded_outward() -> None:
    ball = arb(0, 1)
    (middle,), (radius,) = balls._floats([ball])
    assert middle == 0
    assert float(ball.rad()) <= radius <= float(ball.rad()) * (1 + 1e-15)


def test_the_direction_is_that_of_the_problem() -> None:
    s = roots([1.5], [2.0])
    s.p.along = np.arange(6.0)
    assert Balls(s).along.tolist() == [0, 1, 2, 3, 4, 5]


def test_rows_that_are_held_are_where_they_are_held() -> None:
    s = roots([1.5, 1.5], [2.0, 3.0])
    s.of_modes.rows = SimpleNamespace(held=np.array([False, True]), at=np.array([5.0, -1.75]))
    box = balls.refined(s)
    assert box.d.tolist() == [pytest.approx(2**0.5), -1.75]
    assert box.d_off[1] == 2 * 1.75 * 2.0**-53


def test_without_equations_the_start_is_kept() -> None:
    s = roots([1.5], [2.0])
    s.value = np.zeros(0)
    assert balls.refined(s).v.tolist() == [1.5]


@pytest.mark.parametrize(
    ("start", "square"), [(1.0, -1.0), (-1.0, 1.0), (1.0, 0.0)], ids=["no root", "no direction of sliding", "double"]
)
def test_what_has_no_box(start: float, square: float) -> None:
    with pytest.raises(NotShown) as caught:
        balls.refined(roots([start], [square]))
    assert not caught.value.rounding


def test_every_speed_has_to_be_positive() -> None:
    for starts in ([0.0, 1.0], [1.0, -1.0]):
        with pytest.raises(ZeroDivisionError):
            Balls(roots(starts, [1.0, 1.0], [1.0, 1.0])).at(np.array([arb(x) for x in starts]))


@pytest.mark.parametrize(
    ("inverse", "rounds", "radius"),
    [
        (1 / 3, 1, 0.125),  # error 1/12: 1/4 + 3/8 / 12 <= 3/8
        (0.45, 1, None),  # error 0.35 + 0.151875: 1/4 + 3/8 0.501875 > 3/8
        (0.45, 2, 0.45 * 0.6573046875),  # 1.5 times that is radius; error 0.35 + 0.2662: 0.655 <= 0.6573
        (0.7, 5, None),  # beyond 0.45 times radius 1.5 |F'| C is more than 1
    ],
)
def test_which_balls_are_kept(inverse: float, rounds: int, radius: float | None) -> None:
    """About 3/2 of x^2 = 2, where 1/4 is missed."""
    found = Balls(roots([1.5], [2.0]))._kept(
        np.array([arb(1.5)]), arb_mat([[arb(inverse)]]), np.array([0.25]), rounds
    )  # fmt: skip
    assert (found is None) == (radius is None)
    if found is not None:
        assert (float(found[0].mid()), float(found[0].rad())) == (1.5, pytest.approx(radius, rel=1e-8))


@pytest.mark.parametrize(
    ("starts", "squares", "units", "near"),
    [
        ([2.0], [4.0], [1.0], True),  # nothing is missed from the start
        ([1.0], [1.21], [1.0], False),  # each step leaves a tenth
        ([1.0], [1 + 2e-6], [1.0], True),  # each step leaves a millionth
        ([1.0, 1.0], [1 + 2e-6, 1.21], [1.0, 1e-60], True),  # as far as the units say
        ([1.0, 1.0], [1 + 2e-6, 1.21], [1e-60, 1.0], False),
    ],
)
def test_steps_with_one_inverse(starts: list[float], squares: list[float], units: list[float], near: bool) -> None:
    s = roots(starts, squares, units=units)
    with ctx.workprec(320):
        found = Balls(s)._nearer(balls.number(s.inverse))
    assert (found is not None) == near
    if found is not None:
        assert float(found[0].mid()) == pytest.approx(squares[0] ** 0.5, rel=1e-15)


def test_every_equation_has_to_be_kept() -> None:
    both = Balls(roots([1.5, 1.0], [2.0, 2.0]))
    x, C = np.array([arb(1.5), arb(1)]), arb_mat([[arb(1 / 3), 0], [0, arb(0.5)]])
    assert both._kept(x, C, np.array([0.25, 1.0]), 1) is None
    kept = both._kept(x, C, np.zeros(2), 1)
    assert kept is not None
    assert [(float(y.mid()), float(y.rad())) for y in kept] == [(1.5, 0.0), (1.0, 0.0)]
