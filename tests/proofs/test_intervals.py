"""Interval arithmetic: every operation encloses exact results, and is no wider than it has to be."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.intervals import (
    Dual,
    Interval,
    columns,
    cos,
    cross,
    crossing,
    dot,
    join,
    norm,
    orthonormal,
    sin,
    sqr,
    sqrt,
    unit,
)
from tests.support.enclosures import exact, holds, intervals, points

FIELD: dict[str, Callable] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


@pytest.mark.parametrize("sign", FIELD)
def test_field_operations_enclose_fractions(sign: str) -> None:
    rng, op = np.random.default_rng(0), FIELD[sign]
    a, b = intervals(rng, (1500,)), intervals(rng, (1500,))
    with np.errstate(all="ignore"):
        result, mixed, turned = op(a, b), op(a, b.lo), op(a.lo, b)
        for x, y in zip(points(rng, a), points(rng, b), strict=True):
            ok = np.isfinite(x) & np.isfinite(y) & ((y != 0) | (sign != "/"))
            for r, (p, q) in ((result, (x, y)), (mixed, (x, b.lo)), (turned, (a.lo, y))):
                use = ok & (q != 0) if sign == "/" else ok
                assert holds(r[use], op(exact(p[use]), exact(q[use])))


@pytest.mark.parametrize("sign", FIELD)
def test_field_operations_are_tight(sign: str) -> None:
    """Of exact operands: at most eight units in the last place wide; of wide ones no wider than their range."""
    rng, op = np.random.default_rng(1), FIELD[sign]
    a, b = rng.normal(size=500), rng.normal(size=500)
    r = op(Interval.of(a), Interval.of(b))
    assert (r.hi - r.lo <= 8 * np.spacing(r.mag)).all()
    x, y = Interval.around(a, 0.1), Interval.around(np.where(b > 0, b + 0.2, b - 0.2), 0.1)
    r = op(x, y)
    corners = [op(p, q) for p in (x.lo, x.hi) for q in (y.lo, y.hi)]
    np.testing.assert_allclose(r.lo, np.min(corners, axis=0), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(r.hi, np.max(corners, axis=0), rtol=1e-14, atol=1e-14)


def test_division_by_zero_has_no_bounds() -> None:
    with np.errstate(all="ignore"):
        r = Interval.of([1.0, 1.0, 0.0]) / Interval.between(np.array([-1.0, 0.0, 0.0]), np.array([1.0, 2.0, 0.0]))
    assert (r.lo == -np.inf).all()
    assert (r.hi == np.inf).all()


def test_what_overflows_proves_nothing() -> None:
    big = Interval.of(np.array([1e200]))
    with np.errstate(all="ignore"):
        for x in (
            big * big - big * big,
            (big * big) @ np.zeros((1, 1)),
            big * big / (big * big),
            sqrt(big * big * 0.0),
        ):
            assert not (x.lo > -1e300).any()
            assert not (x.hi < 1e300).any()


@pytest.mark.parametrize(
    "shapes", [((5, 3), (3, 4)), ((7, 3, 3), (3, 2)), ((2, 1, 2, 16), (3, 16, 2)), ((1, 1), (1, 1))]
)
def test_matrix_products_enclose_fractions(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    rng = np.random.default_rng(2)
    for size in (1.0, 1e-160, 1e140):
        pairs = [
            (Interval.of(m), Interval.around(m, 1e-3 * np.abs(m))) for m in (size * rng.normal(size=s) for s in shapes)
        ]
        for a, b in zip(*pairs, strict=True):
            results = [a @ b, a @ b.lo, a.lo @ b]
            for x, y in zip(points(rng, a), points(rng, b), strict=True):
                for r, (p, q) in zip(results, ((x, y), (x, b.lo), (a.lo, y)), strict=True):
                    assert holds(r, exact(p) @ exact(q))


def test_matrix_products_are_tight() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(20, 3, 3)), rng.normal(size=(20, 3, 3))
    r = Interval.of(a) @ Interval.of(b)
    assert (r.hi - r.lo <= 16 * 2.0**-52 * (np.abs(a) @ np.abs(b))).all()
    r = Interval.around(a, 1e-6) @ Interval.around(b, 1e-6)
    width = 2e-6 * (np.abs(a).sum(axis=-1)[:, :, None] + np.abs(b).sum(axis=-2)[:, None, :])
    assert (r.hi - r.lo <= width * 1.01).all()


@pytest.mark.parametrize("count", [1, 2, 3, 17, 300])
def test_sums_enclose_fractions(count: int) -> None:
    rng = np.random.default_rng(count)
    a = intervals(rng, (20, count))
    with np.errstate(all="ignore"):
        total = a.sum()
    for x in points(rng, a):
        ok = np.isfinite(x).all(axis=1)
        assert holds(total[ok], exact(x[ok]).sum(axis=1))


def test_vectors_enclose_fractions() -> None:
    rng = np.random.default_rng(4)
    a, b = (Interval.around(rng.normal(size=(50, 3)), 1e-9) for _ in range(2))
    for x, y in zip(points(rng, a), points(rng, b), strict=True):
        p, q = exact(x), exact(y)
        assert holds(dot(a, b), (p * q).sum(axis=1))
        vector = np.stack([p[:, i - 2] * q[:, i - 1] - p[:, i - 1] * q[:, i - 2] for i in range(3)], -1)
        assert holds(cross(a, b), vector)
        assert holds(sqr(a), p * p)
        assert holds(-a, -p)
    lengths = sqrt(sqr(unit(a)).sum())
    assert lengths.contains(1.0).all()
    assert (lengths.hi - lengths.lo < 1e-7).all()


def test_squares_are_not_negative() -> None:
    r = sqr(Interval.between(np.array([-1.0, -3.0, 2.0, 0.0]), np.array([2.0, -2.0, 3.0, 0.0])))
    assert r.lo.tolist()[0] == 0.0
    assert r.lo.tolist()[3] == 0.0
    np.testing.assert_allclose(r.lo, [0, 4, 4, 0], atol=1e-14)
    np.testing.assert_allclose(r.hi, [4, 9, 9, 0], atol=1e-14)


# --- functions --------------------------------------------------------------------------------------


def angles(rng: np.random.Generator) -> Array:
    """Ordinary, tiny, large ones, and floats next to the crests, troughs and zeros."""
    quarter = np.arange(-9, 10) * (math.pi / 2)
    near = np.concatenate([quarter, np.nextafter(quarter, 9e9), np.nextafter(quarter, -9e9), quarter + 1e-9])
    far = [1e3, 99999.0, 1e5, 123456.7, -1e10, 1e300]
    return np.concatenate([rng.uniform(-7, 7, 200), 10.0 ** rng.uniform(-320, 0, 50), near, far, [0.0]])


@pytest.mark.parametrize("name, function", [("sin", sin), ("cos", cos), ("sqrt", sqrt)])
def test_functions_enclose_balls(name: str, function: Callable) -> None:
    flint = pytest.importorskip("flint")
    rng = np.random.default_rng(5)
    a = angles(rng)
    a = np.abs(a) if name == "sqrt" else a
    for width in (0.0, 1e-15, 1e-7, 0.01, 1.0, 3.0, 7.0):
        x = Interval.between(a, a + width * rng.uniform(size=a.shape))
        r = function(x)
        assert (np.isfinite(r.lo) & np.isfinite(r.hi)).all()
        with flint.ctx.workprec(3000):
            for p in points(rng, x):
                values = [getattr(flint.arb(v), name)() for v in p.tolist()]
                assert all(
                    flint.arb(lo) <= v and v <= flint.arb(hi)
                    for lo, v, hi in zip(r.lo.tolist(), values, r.hi.tolist(), strict=True)
                )


@pytest.mark.parametrize("function, at_zero", [(sin, 0), (cos, 1)])
def test_sine_and_cosine_between_crests(function: Callable, at_zero: int) -> None:
    """Exact ranges where the interval holds a crest, a trough, both or neither."""
    shift = 0.0 if function is sin else -math.pi / 2
    x = Interval.between(np.array([0.1, -3.0, -2.0, 0.1, 2.0, -40.0]), np.array([2.0, -0.5, 2.0, 1.0, 4.0, 50.0]))
    x = Interval.between(x.lo + shift, x.hi + shift)
    r = function(x)
    low = [math.sin(0.1), -1, -1, math.sin(0.1), math.sin(4.0), -1]
    high = [1, math.sin(-3.0), 1, math.sin(1.0), math.sin(2.0), 1]
    np.testing.assert_allclose(r.lo, low, atol=1e-15)
    np.testing.assert_allclose(r.hi, high, atol=1e-15)
    assert r.mag.max() <= 1
    thin = function(Interval.of(np.linspace(-6, 6, 1000)))
    assert (thin.hi - thin.lo <= 24 * np.spacing(thin.mag)).all()
    assert function(Interval.of(0.0)).contains(float(at_zero)).all()


def test_the_platform_keeps_what_is_assumed() -> None:
    """Sine and cosine within the units in the last place that the enclosure allows for."""
    flint = pytest.importorskip("flint")
    rng = np.random.default_rng(6)
    for name, function in (("sin", math.sin), ("cos", math.cos)):
        for v in rng.uniform(-10, 10, 3000).tolist():
            value = function(v)
            with flint.ctx.workprec(200):
                assert abs(getattr(flint.arb(v), name)() - value) < 4 * math.ulp(value)


# --- shapes, whole numbers, and bounds that are no wider than they have to be ---------------------------


def test_whole_numbers_become_floats() -> None:
    """2^40 as a whole number of 64 bits would overflow when squared."""
    big = Interval.of([2**40, -3])
    assert big.lo.dtype == big.hi.dtype == float
    assert holds(big * big * big, np.array([Fraction(2**120), Fraction(-27)], dtype=object))
    around = Interval.around([2**62, 5], [2**62, 1])
    assert around.contains(np.array([2.0**63, 4.0])).all()
    assert around.contains(np.array([0.0, 6.0])).all()


def test_contains_counts_both_ends_and_nothing_beyond() -> None:
    x = Interval.between(np.array([-1.0, 2.0]), np.array([1.0, 2.0]))
    assert x.contains(np.array([-1.0, 2.0])).tolist() == [True, True]
    assert x.contains(np.array([1.0, 2.0])).tolist() == [True, True]
    assert x.contains(np.nextafter([-1.0, 2.0], -9)).tolist() == [False, False]
    assert x.contains(np.nextafter([1.0, 2.0], 9)).tolist() == [False, False]


def test_shapes_are_numpys() -> None:
    lo = np.arange(24.0).reshape(2, 3, 4)
    x = Interval.between(lo, lo + 0.5)
    for got, expected in ((x.swapped(), lo.swapaxes(1, 2)), (x.reshape(4, 6), lo.reshape(4, 6))):
        np.testing.assert_array_equal(got.lo, expected)
        np.testing.assert_array_equal(got.hi, expected + 0.5)
    still = Dual.constant(x, 5)
    np.testing.assert_array_equal(still.value.hi, lo + 0.5)
    assert still.slope.shape == (5, 2, 3, 4)
    assert not still.slope.mag.any()
    np.testing.assert_array_equal(x[..., 1].lo, lo[..., 1])
    np.testing.assert_array_equal(x[..., None, :].hi, lo[..., None, :] + 0.5)
    np.testing.assert_array_equal(x[1].lo, lo[1])
    np.testing.assert_array_equal(x[:, 2].hi, lo[:, 2] + 0.5)
    np.testing.assert_array_equal(x[1, 2].lo, lo[1, 2])


def test_functions_keep_the_shape() -> None:
    angles = np.linspace(-9, 9, 24).reshape(2, 3, 4)
    x = Interval.between(angles, angles + 0.01)
    for function, true in ((sin, np.sin), (cos, np.cos)):
        got = function(x)
        assert got.shape == (2, 3, 4)
        assert (got.lo <= true(angles + 0.005)).all()
        assert (true(angles + 0.005) <= got.hi).all()


def test_a_product_of_single_terms_allows_for_its_rounding() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(40, 1)), rng.normal(size=(1, 40))
    assert holds(Interval.of(a) @ Interval.of(b), exact(a) * exact(b))


def test_a_sum_is_bounded_row_by_row() -> None:
    """The rounding of a row of large numbers is none of the others' business."""
    x = Interval.of(np.array([[1e9, 2e9, 3e9], [1e-3, 2e-3, 3e-3]]))
    width = x.sum().hi - x.sum().lo
    assert width[1] < 1e-16
    assert width[0] > 1e-7
    assert holds(Interval.of(np.array([0.1, 0.2, 0.3])).sum(), exact(np.array([0.1, 0.2, 0.3])).sum())


def test_the_square_of_what_may_be_zero_reaches_zero() -> None:
    x = Interval.between(np.array([-0.5, -0.5, 0.0, -3.0, 0.25]), np.array([0.5, 0.0, 0.5, 2.0, 0.5]))
    assert sqr(x).lo[:4].tolist() == [0, 0, 0, 0]
    assert sqr(x).lo[4] == pytest.approx(0.0625)


def test_joining_one_part_is_that_part() -> None:
    x = Interval.of(np.array([1.0, 2.0]))
    np.testing.assert_array_equal(join([x], -1).lo, x.lo)
    np.testing.assert_array_equal(join([Dual.constant(x, 2)], -1).slope.lo, np.zeros((2, 2)))


@pytest.mark.parametrize("function", [sin, cos])
def test_waves_stay_between_one_and_minus_one(function: Callable) -> None:
    """Near a crest or a trough too, where the value and its rounding are beyond."""
    near = np.array([s * 10.0**-k for k in range(3, 12) for s in (1, -1)])
    points = np.concatenate([near + k * np.pi / 2 for k in range(-4, 5)])
    got = function(Interval.of(points))
    assert got.lo.min() == -1.0
    assert got.hi.max() == 1.0
    assert (got.hi - got.lo).max() < 1e-13


def test_an_angle_beyond_the_range_says_nothing_and_one_at_its_end_does() -> None:
    x = Interval.of(np.array([1e5, -1e5, np.nextafter(1e5, 2e5), 1e300]))
    got = sin(x)
    assert ((got.hi - got.lo)[:2] < 1e-13).all()
    assert (got.lo[2:].tolist(), got.hi[2:].tolist()) == ([-1, -1], [1, 1])


# --- one by one, by hand --------------------------------------------------------------------------------


def between(lo: object, hi: object) -> Interval:
    return Interval.between(np.asarray(lo, dtype=float), np.asarray(hi, dtype=float))


def just(x: Interval, lo: object, hi: object) -> bool:
    """Are these the ends, each moved out by 2 to 5 times the relative rounding error of 2^-53, or by 1e-290?"""
    for end, exactly in ((-x.lo, np.negative(np.asarray(lo, dtype=float))), (x.hi, np.asarray(hi, dtype=float))):
        moved, size = end - exactly, np.abs(exactly)
        if (
            x.shape != size.shape
            or not ((moved >= 2 * 2.0**-53 * size) & (moved <= 5 * 2.0**-53 * size + 2e-290)).all()
        ):
            return False
        if not (end > exactly).all():
            return False
    return True


def test_ends_and_what_follows_from_them() -> None:
    x = between([[1, -5], [0, 2]], [[2, 3], [0, 2]])
    assert x.ends.tolist() == [[[-1, 2], [5, 3]], [[0, 0], [-2, 2]]]
    assert (x.lo.tolist(), x.hi.tolist(), x.shape) == ([[1, -5], [0, 2]], [[2, 3], [0, 2]], (2, 2))
    assert x.mid.tolist() == [[1.5, -1], [0, 2]]
    assert x.mag.tolist() == [[2, 5], [0, 2]]
    assert Interval.of([[1, 2]]).ends.tolist() == [[[-1, 1], [-2, 2]]]
    assert (-x).ends.tolist() == x.ends[..., ::-1].tolist()
    assert x[0].ends.tolist() == x.ends[0].tolist()
    assert x[..., 0].ends.tolist() == [[-1, 2], [0, 0]]
    assert x[:, 1].ends.tolist() == [[5, 3], [-2, 2]]
    assert x[(1, 1)].ends.tolist() == [-2, 2]
    assert x.reshape(4).ends.tolist() == x.ends.reshape(4, 2).tolist()
    assert x.swapped().ends.tolist() == x.ends.transpose(1, 0, 2).tolist()
    assert just(Interval.around([3.0, -1.0], 0.25), [2.75, -1.25], [3.25, -0.75])
    assert just(Interval.around(0.5, [0.25, 0.0]), [0.25, 0.5], [0.75, 0.5])


A, B = between([1, -2, -3, 4e9], [2, 3, -1, 4e9]), between([3, -5, 4, -2], [5, 7, 8, -1])


def test_sums_and_differences_by_hand() -> None:
    assert just(A + B, [4, -7, 1, 4e9 - 2], [7, 10, 7, 4e9 - 1])
    assert just(A - B, [-4, -9, -11, 4e9 + 1], [-1, 8, -5, 4e9 + 2])
    assert just(A + 1.5, [2.5, -0.5, -1.5, 4e9 + 1.5], [3.5, 4.5, 0.5, 4e9 + 1.5])
    assert just(1.5 + A, [2.5, -0.5, -1.5, 4e9 + 1.5], [3.5, 4.5, 0.5, 4e9 + 1.5])
    assert just(A - 1.5, [-0.5, -3.5, -4.5, 4e9 - 1.5], [0.5, 1.5, -2.5, 4e9 - 1.5])
    assert just(1.5 - A, [-0.5, -1.5, 2.5, 1.5 - 4e9], [0.5, 3.5, 4.5, 1.5 - 4e9])
    assert just(np.array([8.0, 4, 2, 1]) - A, [6, 1, 3, 1 - 4e9], [7, 6, 5, 1 - 4e9])
    assert just(Interval.of(0.0) + 0.0, 0, 0)


def test_products_and_quotients_by_hand() -> None:
    assert just(A * B, [3, -15, -24, -8e9], [10, 21, -4, -4e9])
    assert just(B * A, [3, -15, -24, -8e9], [10, 21, -4, -4e9])
    assert just(A * 2.0, [2, -4, -6, 8e9], [4, 6, -2, 8e9])
    assert just(-2.0 * A, [-4, -6, 2, -8e9], [-2, 4, 6, -8e9])
    assert just(A * 0.0, [0] * 4, [0] * 4)
    by = np.array([2.0, -2, -0.0, -1])
    assert just(A * by, [2, -6, 0, -4e9], [4, 4, 0, -4e9])
    assert just(by * A, [2, -6, 0, -4e9], [4, 4, 0, -4e9])
    over = between([4, -8, 2, -4], [8, -4, 4, -2])
    assert just(A / over, [1 / 8, -3 / 4, -3 / 2, -2e9], [1 / 2, 1 / 2, -1 / 4, -1e9])
    assert just(A / 4.0, [1 / 4, -1 / 2, -3 / 4, 1e9], [1 / 2, 3 / 4, -1 / 4, 1e9])
    assert just(8.0 / over, [1, -2, 2, -4], [2, -1, 4, -2])
    assert just(by / between([1] * 4, [2] * 4), [1, -2, 0, -1], [2, -1, 0, -0.5])
    with np.errstate(all="ignore"):
        for zero in (between(-1, 1), between(0, 1), between(-1, 0), Interval.of(0.0)):
            assert (1.0 / zero).ends.tolist() == [np.inf, np.inf]


def test_matrix_products_by_hand() -> None:
    """[1, 3] -2 + [3, 5] [-1, 7] and the like: midpoints and radii overestimate by what both radii make together."""
    a, b = between([[1, 3]], [[3, 5]]), between([[-2], [-1]], [[-2], [7]])
    found = a @ b
    assert found.shape == (1, 1)
    # 2 -2 + 4 3 = 8; of radii 1 2 + 1 3 + 4 4 + 1 4 = 25
    assert (found.lo[0, 0], found.hi[0, 0]) == (pytest.approx(-17, rel=1e-14), pytest.approx(33, rel=1e-14))
    assert found.lo[0, 0] < -17
    assert found.hi[0, 0] > 33
    for one in (a.mid @ b, a.mid @ Interval.of(b.mid), a @ b.mid):
        assert one.contains(8.0).all()
    assert (a.mid @ b).mag == pytest.approx(8 + 4 * 4, rel=1e-14)
    assert (a @ b.mid).mag == pytest.approx(8 + 2 + 3, rel=1e-14)
    thin = Interval.of([[4.0, -8.0]]) @ Interval.of([[2.0], [-1.0]])
    # 16, by 4 roundings of 2^-52 of sizes, and what an interval from a middle is rounded
    assert 16 * 4 * 2.0**-52 <= thin.hi[0, 0] - 16 <= 16 * 7 * 2.0**-52
    assert 16 * 4 * 2.0**-52 <= 16 - thin.lo[0, 0] <= 16 * 7 * 2.0**-52
    zero = Interval.of([[0.0]]) @ Interval.of([[0.0]])
    assert 1e-290 <= zero.mag[0, 0] <= 2.1e-290


def test_sums_over_the_last_axis_by_hand() -> None:
    found = between([[1, -3], [0, 0]], [[2, 5], [0, 0]]).sum()
    assert found.shape == (2,)
    # 4 times 2^-52 of what the absolute values add up to, 4 below and 7 above
    assert (found.lo[0], found.hi[0]) == (-2 - 4 * 4 * 2.0**-52, 7 + 7 * 4 * 2.0**-52)
    assert (found.lo[1], found.hi[1]) == (-1e-290, 1e-290)


def dual(value: float, *slopes: float) -> Dual:
    return Dual(Interval.of([value]), Interval.of([[x] for x in slopes]))


def like(x: Dual, value: float, *slopes: float) -> bool:
    found = [x.value.mid[0], *x.slope.mid[:, 0]]
    thin = (x.value.hi - x.value.lo).max() < 1e-13 and (x.slope.hi - x.slope.lo).max() < 1e-13
    return thin and x.slope.shape == (len(slopes), 1) and found == pytest.approx([value, *slopes], rel=1e-14)


def test_derivatives_by_hand() -> None:
    """Of x = 2 and y = 4 with derivatives (1, 3) and (5, -1), and of constants beside them."""
    x, y, three = dual(2, 1, 3), dual(4, 5, -1), np.array([3.0])
    assert like(x + y, 6, 6, 2)
    assert like(x - y, -2, -4, 4)
    assert like(x * y, 8, 1 * 4 + 2 * 5, 3 * 4 - 2 * 1)
    assert like(y / x, 2, (5 - 2 * 1) / 2, (-1 - 2 * 3) / 2)
    assert like(-x, -2, -1, -3)
    for c in (3.0, three, Interval.of(three)):
        assert like(x + c, 5, 1, 3)
        assert like(c + x, 5, 1, 3)
        assert like(x - c, -1, 1, 3)
        assert like(c - x, 1, -1, -3)
        assert like(x * c, 6, 3, 9)
        assert like(c * x, 6, 3, 9)
        assert like(x / c, 2 / 3, 1 / 3, 1)
    assert like(sqr(x), 4, 4, 12)
    assert like(sqrt(y), 2, 5 / 4, -1 / 4)
    assert like(sin(x), np.sin(2), np.cos(2), 3 * np.cos(2))
    assert like(cos(x), np.cos(2), -np.sin(2), -3 * np.sin(2))
    assert like(join([x, y], -1)[..., 1:], 4, 5, -1)
    total = join([x, y], -1).sum()
    assert [total.value.mid, *total.slope.mid] == pytest.approx([6, 6, 2])
    assert like(join([x, y], -1).some(np.array([1])), 4, 5, -1)


def test_derivatives_of_matrix_products_by_hand() -> None:
    """Of A = [[1, 2]] and B = [[3], [4]] whose entries change by [[5, 6]] and [[7], [8]] with a single variable."""
    a, b = (Dual(Interval.of(v), Interval.of([s])) for v, s in (([[1, 2]], [[5, 6]]), ([[3], [4]], [[7], [8]])))
    both, left, right = a @ b, a @ b.value, a.value @ b
    plain = np.array([[1.0, 2.0]]) @ b
    assert [m.value.mid.item() for m in (both, left, right, plain)] == pytest.approx([11] * 4)
    assert [m.slope.mid.item() for m in (both, left, right, plain)] == pytest.approx([39 + 23, 39, 23, 23])
    assert a.swapped().value.mid.tolist() == [[1], [2]]
    assert a.swapped().slope.mid.tolist() == [[[5], [6]]]


def test_squares_and_roots_by_hand() -> None:
    assert just(sqr(between([2, -3, -3, 0], [3, -2, 2, 0]))[:2], [4, 4], [9, 9])
    assert sqr(between(-3, 2)).hi == pytest.approx(9, rel=1e-15)
    assert sqr(between(-3, 2)).hi > 9
    assert sqr(between([-3, 0], [2, 1])).lo.tolist() == [0, 0]
    assert just(sqrt(between([4, 1], [9, 16])), [2, 1], [3, 4])
    assert sqrt(between(-1.0, 4.0)).lo == 0
    assert sqrt(between(1e-300, 4.0)).lo > 0
    with np.errstate(all="ignore"):
        assert np.isnan(sqrt(between(-2.0, -1.0)).hi)


def test_waves_by_hand() -> None:
    """Of ends, and where a crest or a trough lies between them; both where the interval is a turn or too far away."""
    h = math.pi / 2
    x = between([0, 0.5, h + 0.5, -0.5, 0.1, 1e5, 2e5], [0, h + 0.1, 2 * h, 3 * h, 7, 1e5, 2e5])
    for got in (sin(x), cos(x - h)):
        low = [0, math.sin(0.5), 0, -1, -1, math.sin(1e5), -1]
        high = [0, 1, math.sin(h + 0.5), 1, 1, math.sin(1e5), 1]
        assert np.abs(got.lo - low).max() < 1e-10
        assert np.abs(got.hi - high).max() < 1e-10
    at = sin(Interval.of([0.5, -0.5, 0.0]))
    for end, sign in ((at.hi, 1), (at.lo, -1)):
        moved = sign * (end - np.sin([0.5, -0.5, 0.0]))
        assert moved[:2] == pytest.approx([5 * 2.0**-52 * math.sin(0.5)] * 2, rel=0.2)
        assert moved[2] == 1e-290


def test_vectors_by_hand() -> None:
    a, b = Interval.of([[1.0, 2, 3]]), Interval.of([[5.0, 7, 11]])
    assert cross(a, b).mid.tolist() == pytest.approx(np.array([[1, 4, -3]]))
    assert dot(a, b).mid.tolist() == pytest.approx([52])
    assert unit(Interval.of([[3.0, 0, 4]])).mid == pytest.approx(np.array([[0.6, 0, 0.8]]))
    assert norm(Interval.of([[3.0, 0, 4]])).mid == pytest.approx([5])
    assert crossing(a).mid == pytest.approx(np.array([[[0, -3, 2], [3, 0, -1], [-2, 1, 0]]]), abs=1e-200)
    assert columns([a, b]).mid.tolist() == [[[1, 5], [2, 7], [3, 11]]]
    assert join([a, b], -1).mid.tolist() == [[1, 2, 3, 5, 7, 11]]
    assert join([a, b], -2).mid.tolist() == [[1, 2, 3], [5, 7, 11]]
    R = orthonormal(np.array([[0, 0, 2.0]]), np.array([[3.0, 0, 5]]))  # z, then x without its part along z
    assert R.mid == pytest.approx(np.array([[[0, 1, 0], [0, 0, 1], [1, 0, 0]]]), abs=1e-14)
    assert (R.hi - R.lo).max() < 1e-13


@pytest.mark.parametrize("angle", [0.5, -0.5])
def test_a_wave_is_5_units_in_the_last_place_wider_either_way(angle: float) -> None:
    x, true = sin(Interval.of(angle)), math.sin(angle)
    for moved in (x.hi - true, true - x.lo):
        assert 4.5 < moved / (abs(true) * 2.0**-52) < 5.6


def test_whole_numbers_around_others() -> None:
    """Their sum is no whole number of 64 bits."""
    assert Interval.around(2**62, 2**62).hi >= 2.0**63
    assert Interval.around(2**62, 0.5).contains(2.0**62)


def test_nothing_is_divided_by_a_number_with_derivatives_but_another_one() -> None:
    with pytest.raises(TypeError, match="unsupported operand"):
        Interval.of([1.0]) / dual(2, 1)
