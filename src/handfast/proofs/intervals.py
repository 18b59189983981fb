"""Interval arithmetic in numpy, rounded outwards, and forward-mode derivatives of it.

What an operation returns contains every exact result for numbers out of its operands. That rests on this
and on nothing else:

- float64 operations and the square root round to nearest (IEEE 754); subnormal numbers are not cut to zero.
  A result r is then wrong by at most r / 2^53, or by 2^-1075 where it underflows; `_up` moves both ends by
  more than that. Sums are bounded for any order of their terms, so fused and blocked ones will do.
- `math.sin` and `math.cos` are wrong by at most 4 units in the last place, in reality by less than one.
  numpy's are not used: their vector code is free to be less accurate.

Overflow makes infinities and 0 times infinity makes NaN, which fails every comparison: a claim that is
tested as "this holds", never as "its contrary does not", is then not proved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from handfast.proofs.fields import Array, Integers, Mask

MACHINE_EPSILON = 2.0**-52  # twice the relative error of one rounded operation
UNDERFLOW_BOUND = 1e-290  # more than underflow can lose; not smaller, as subnormal numbers are slow
LIBM = 4  # units in the last place by which a sine or cosine may be wrong
MAX_SINE_ANGLE = 1e5  # [rad] an angle beyond this may have any sine
TURN_RADIANS = 2 * math.pi
TURN_ROUNDING = 1e-9  # of a turn: more than the rounding of an angle below FAR in turns


@dataclass(frozen=True, eq=False, slots=True)
class Interval:
    """All arrays between `lo` and `hi`, entry by entry.

    A float or an array beside an interval is exact. Indexing, shapes and broadcasting are numpy's; an index counts axes
    from the first or, with `...` at its beginning, from the last.

    Attributes:
        ends: (..., 2) -lo and hi: outwards is upwards for both.
    """

    ends: Array
    __array_ufunc__ = None  # array * interval comes to __rmul__

    @classmethod
    def between(cls, lo: Array, hi: Array) -> Interval:
        """From lo to hi."""
        return cls(_pair(np.negative(lo), hi))

    @classmethod
    def of(cls, x: object) -> Interval:
        """Exactly x."""
        a = np.asarray(x, dtype=float)
        return cls.between(a, a)

    @classmethod
    def around(cls, middle: object, radius: object) -> Interval:
        """[middle - radius, middle + radius], rounded outwards."""
        m, r = np.asarray(middle, dtype=float), np.asarray(radius, dtype=float)
        return _up(_pair(r - m, r + m))

    @property
    def lo(self) -> Array:
        """The lower ends."""
        return -self.ends[..., 0]

    @property
    def hi(self) -> Array:
        """The upper ends."""
        return self.ends[..., 1]

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of each end."""
        return self.ends.shape[:-1]

    @property
    def mid(self) -> Array:
        """A float in each interval."""
        return 0.5 * (self.ends[..., 1] - self.ends[..., 0])

    @property
    def mag(self) -> Array:
        """The largest absolute value in each interval, exactly."""
        return np.maximum(self.ends[..., 0], self.ends[..., 1])

    def contains(self, x: Array | float) -> Mask:
        """Is x (a float array) inside, ends included?"""
        return np.asarray((self.lo <= x) & (x <= self.hi))

    def __getitem__(self, key: Any) -> Interval:
        from_last = isinstance(key, tuple) and key[0] is Ellipsis
        return Interval(self.ends[(*key, slice(None))] if from_last else self.ends[key])

    def reshape(self, *shape: int) -> Interval:
        """As numpy's."""
        return Interval(self.ends.reshape(*shape, 2))

    def swapped(self) -> Interval:
        """The transpose of the last two axes."""
        return Interval(self.ends.swapaxes(-2, -3))

    def __neg__(self) -> Interval:
        return Interval(self.ends[..., ::-1])

    def __add__(self, other: Interval | Array | float) -> Interval:
        if isinstance(other, Dual):
            return NotImplemented
        return _up(self.ends + _interval(other).ends)

    __radd__ = __add__

    def __sub__(self, other: Interval | Array | float) -> Interval:
        if isinstance(other, Dual):
            return NotImplemented
        return _up(self.ends + _interval(other).ends[..., ::-1])

    def __rsub__(self, other: Array | float) -> Interval:
        return _interval(other) - self

    def __mul__(self, other: Interval | Array | float) -> Interval:
        if isinstance(other, Dual):
            return NotImplemented
        if isinstance(other, Interval):
            return _hull(np.multiply, self.ends, other.ends)
        if isinstance(other, float):
            return _up((self.ends if other >= 0 else self.ends[..., ::-1]) * abs(other))
        by = np.asarray(other, dtype=float)[..., None]
        return _up(np.where(by < 0, self.ends[..., ::-1], self.ends) * np.abs(by))

    __rmul__ = __mul__

    def __truediv__(self, other: Interval | Array | float) -> Interval:
        if isinstance(other, Dual):
            return NotImplemented
        by = _interval(other).ends
        out = _hull(np.divide, self.ends, by).ends
        apart = (by < 0).any(axis=-1, keepdims=True)  # from 0; a quotient by an interval with 0 may be anything
        return Interval(np.where(apart, out, np.inf))

    def __rtruediv__(self, other: Array | float) -> Interval:
        return Interval.of(other) / self

    def __matmul__(self, other: Interval | Array) -> Interval:
        """Matrix product of stacks of matrices, by midpoints and radii (Rump 1999)."""
        if isinstance(other, Dual):
            return NotImplemented
        (a, ra), (b, rb) = _ball(self), _ball(_interval(other))
        k, size = a.shape[-1], np.abs(b)
        # |fl(a b) - a b| <= k ULP |a| |b|; the factor covers every rounding of the radius itself
        radius = (np.abs(a) @ (rb + (k + 2) * MACHINE_EPSILON * size) + ra @ (size + rb)) * (
            1 + (k + 16) * MACHINE_EPSILON
        ) + UNDERFLOW_BOUND
        return Interval.around(a @ b, radius)

    def __rmatmul__(self, other: Array) -> Interval:
        return Interval.of(other) @ self

    def sum(self) -> Interval:
        """Over the last axis."""
        slack = _sums(np.abs(self.ends)) * ((self.ends.shape[-2] + 2) * MACHINE_EPSILON) + UNDERFLOW_BOUND
        return Interval(_sums(self.ends) + slack)


@dataclass(frozen=True, eq=False, slots=True)
class Dual:
    """Intervals of values and of their derivatives in n variables (forward mode).

    Operands of one operation have the same number of axes, so that the axis of the variables stays first;
    an interval, an array or a float beside a dual number is constant and has no more axes than it. Indices
    count axes from the last: `x[..., 0]`.

    Attributes:
        value: (...).
        slope: (n, ...) the derivative of every entry by each variable.
    """

    value: Interval
    slope: Interval
    __array_ufunc__ = None

    @classmethod
    def constant(cls, value: Interval, n: int) -> Dual:
        """A value that depends on none of n variables."""
        return cls(value, Interval(np.zeros((n, *value.ends.shape))))

    def __getitem__(self, key: Any) -> Dual:
        return Dual(self.value[key], self.slope[key])

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    def __add__(self, other: Dual | Interval | Array | float) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value + other.value, self.slope + other.slope)
        return Dual(self.value + other, self.slope)

    __radd__ = __add__

    def __sub__(self, other: Dual | Interval | Array | float) -> Dual:
        return self + -other

    def __rsub__(self, other: Interval | Array | float) -> Dual:
        return -self + other

    def __mul__(self, other: Dual | Interval | Array | float) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value * other.value, self.value * other.slope + self.slope * other.value)
        return Dual(self.value * other, self.slope * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Dual | Interval | Array | float) -> Dual:
        if isinstance(other, Dual):
            ratio = self.value / other.value
            return Dual(ratio, (self.slope - ratio * other.slope) / other.value)
        return Dual(self.value / other, self.slope / other)

    def __matmul__(self, other: Dual | Interval) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.value @ other.value, self.slope @ other.value + self.value @ other.slope)
        return Dual(self.value @ other, self.slope @ other)

    def __rmatmul__(self, other: Interval | Array) -> Dual:
        return Dual(other @ self.value, other @ self.slope)

    def swapped(self) -> Dual:
        """The transpose of the last two axes."""
        return Dual(self.value.swapped(), self.slope.swapped())

    def some(self, its: Integers) -> Dual:
        """Some along the first axis of the values."""
        return Dual(self.value[its], Interval(self.slope.ends[:, its]))

    def sum(self) -> Dual:
        """Over the last axis."""
        return Dual(self.value.sum(), self.slope.sum())


Number = TypeVar("Number", Interval, Dual)


def sqr(x: Number) -> Number:
    """x^2, never negative."""
    if isinstance(x, Dual):
        return Dual(sqr(x.value), 2.0 * x.value * x.slope)
    least = np.maximum(-np.minimum(x.ends[..., 0], x.ends[..., 1]), 0.0)  # 0 if 0 is inside
    out = _up(_pair(-least * least, x.mag * x.mag))
    return Interval.between(np.maximum(out.lo, 0.0), out.hi)


def sqrt(x: Number) -> Number:
    """The square root of what is not negative in x; NaN where nothing is."""
    if isinstance(x, Dual):
        root = sqrt(x.value)
        return Dual(root, x.slope / (2.0 * root))
    out = _up(_pair(-np.sqrt(np.maximum(x.lo, 0.0)), np.sqrt(x.hi)))
    return Interval.between(np.maximum(out.lo, 0.0), out.hi)


def sin(x: Number) -> Number:
    """Sine [rad]."""
    if isinstance(x, Dual):
        return Dual(sin(x.value), cos(x.value) * x.slope)
    return _wave(x, math.sin, math.pi / 2)


def cos(x: Number) -> Number:
    """Cosine [rad]."""
    if isinstance(x, Dual):
        return Dual(cos(x.value), -sin(x.value) * x.slope)
    return _wave(x, math.cos, 0.0)


def dot(a: Number, b: Number) -> Number:
    """Scalar products along the last axis."""
    return (a * b).sum()


def cross(a: Number, b: Number) -> Number:
    """Vector products along the last axis, of length 3."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return a[..., ahead] * b[..., behind] - a[..., behind] * b[..., ahead]


def unit(a: Number) -> Number:
    """Vectors along the last axis, made of length 1."""
    return a / norm(a)[..., None]


def norm(a: Number) -> Number:
    """Lengths of vectors along the last axis."""
    return sqrt(sqr(a).sum())


def join(parts: Sequence[Number], axis: int) -> Number:
    """Concatenated along an axis, which is negative."""
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    if isinstance(first, Dual):
        return Dual(join([p.value for p in parts], axis), join([p.slope for p in parts], axis))
    return Interval(np.concatenate([p.ends for p in parts], axis - 1))


def crossing(axis: Interval) -> Interval:
    """(..., 3, 3) the matrices that take x to axis x x, for axes (..., 3)."""
    return cross(axis[..., None, :], Interval.of(np.eye(3))).swapped()  # columns axis x e_i


def columns(parts: Sequence[Number]) -> Number:
    """Vectors (..., 3) as the columns of matrices (..., 3, number of parts)."""
    return join([p[..., None] for p in parts], -1)


def orthonormal(first: Array, second: Array) -> Interval:
    """(n, 3, 3) rotations with column 0 along `first` (n, 3), column 1 as near to `second` as can be."""
    x, y = unit(Interval.of(first)), Interval.of(second)
    y = unit(y - dot(x, y)[:, None] * x)
    return columns([x, y, cross(x, y)])


def _interval(x: Interval | Array | float) -> Interval:
    return x if isinstance(x, Interval) else Interval.of(x)


def _pair(lower: Array, upper: Array) -> Array:
    """(..., 2) ends from those below, negated, and above."""
    ends = np.empty((*np.shape(lower), 2))
    ends[..., 0], ends[..., 1] = lower, upper
    return ends


def _up(ends: Array) -> Interval:
    """Ends that were rounded once, moved out by more than that rounding and their own."""
    slack = np.abs(ends)
    slack *= 2 * MACHINE_EPSILON
    slack += UNDERFLOW_BOUND
    slack += ends
    return Interval(slack)


def _sums(ends: Array) -> Array:
    """(..., 2) of ends (..., n, 2): numpy's own `sum` is slow along an axis that is not the last."""
    return np.asarray(np.einsum("...ij->...j", ends))


def _hull(result: Callable[[Array, Array], Array], x: Array, y: Array) -> Interval:
    """Of all products, or quotients, of what is between ends (..., 2)."""
    (a, b), (c, d) = (x[..., 0], x[..., 1]), (y[..., 0], y[..., 1])
    lower, upper, first, second = result(a, c), result(b, d), result(a, d), result(b, c)
    return _up(
        _pair(
            np.maximum(np.maximum(first, second), -np.minimum(lower, upper)),
            np.maximum(np.maximum(lower, upper), -np.minimum(first, second)),
        )
    )


def _ball(x: Interval) -> tuple[Array, Array]:
    """Midpoint and radius; the radius is short by at most one rounding, which the product allows for."""
    middle = x.mid
    return middle, np.maximum(x.ends[..., 1] - middle, x.ends[..., 0] + middle)


def _wave(x: Interval, function: Callable[[float], float], crest: float) -> Interval:
    """Sine or cosine: the values at the ends, and 1 or -1 where a crest or a trough may lie between."""
    near = x.mag <= MAX_SINE_ANGLE
    first, last = np.where(near, x.lo, 0.0), np.where(near, x.hi, 0.0)
    at_lo, at_hi = (np.array(list(map(function, e.ravel().tolist()))).reshape(x.shape) for e in (first, last))
    lo, hi = np.minimum(at_lo, at_hi), np.maximum(at_lo, at_hi)
    slack = np.maximum(-lo, hi) * ((LIBM + 1) * MACHINE_EPSILON) + UNDERFLOW_BOUND  # one more for the subtraction

    def passes(peak: float) -> Mask:
        """May the interval contain `peak`, up to full turns?"""
        before, after = (first - peak) / TURN_RADIANS - TURN_ROUNDING, (last - peak) / TURN_RADIANS + TURN_ROUNDING
        return np.asarray(np.floor(after) >= np.ceil(before)) | ~near

    lo = np.where(passes(crest + math.pi), -1.0, np.maximum(lo - slack, -1.0))
    hi = np.where(passes(crest), 1.0, np.minimum(hi + slack, 1.0))
    return Interval.between(lo, hi)
