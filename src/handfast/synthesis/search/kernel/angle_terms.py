"""Conditions on angles over a box, compiled: Taylor polynomials of cosines and triple products, rows made of them.

The polynomials of numbers stand in the slots of a `Terms`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.narrowing import ROW_PADDING, narrow
from handfast.synthesis.search.kernel.taylor import TAYLOR_INFLATION, norm, spread

# slots of the hand; four behind it the object's: cosines of directions i and j with a line, of i with j, line . (i x j)
LINE_I, LINE_J, I_J, TRIPLE = 0, 1, 2, 3
OBJECT_OFFSET = 4
ROW = 15  # slot of a row's derivatives


class Direction(NamedTuple):
    """The Taylor polynomial of a unit vector."""

    value: Any  # (3,) in the middle
    slope: Any  # (n, 3) derivatives
    remainder: Any
    stray: Any  # largest distance from the middle one


@inner
def direction(i, which, polynomials):
    """HAND_DIRECTION or OBJECT_DIRECTION of contact or cone i."""
    return Direction(
        polynomials.value[i, which],
        polynomials.slope[i, which],
        polynomials.remainder[i, which],
        polynomials.swing[i, which],
    )


@inner
def unit(body, remainder, stray, half, use, work):
    """The polynomial of f / |f| into work, a `LineWork`, from that of a line f, `work.line[body]`.

    Its bounds are infinite if f may vanish. Along a straight path the second derivative of f / |f| is at most
    2/sqrt(3) |f'|^2 / |f|^2; the remainder of f itself adds at most its share of |f|.
    """
    f, slope, out, out_slope, bound = (
        work.line[body], work.slope[body], work.unit[body], work.unit_slope[body], work.unit_bound[body],
    )  # fmt: skip
    size = norm(f)
    least = (size - stray) * (2.0 - TAYLOR_INFLATION)
    if not least > 0.2 * size:
        bound[0] = bound[1] = np.inf
        return
    for c in range(3):
        out[c] = f[c] / size
    for i in use:
        along = slope[i, 0] * out[0] + slope[i, 1] * out[1] + slope[i, 2] * out[2]
        for c in range(3):
            out_slope[i, c] = (slope[i, c] - along * out[c]) / size
    straight = stray - remainder
    bound[0] = (remainder / least + 0.578 * straight * straight / (least * least) + ROW_PADDING) * TAYLOR_INFLATION
    bound[1] = spread(out_slope, half, use) + bound[0]


@inner
def _scalar(slot, value, remainder, half, use, terms):
    """Finish the polynomial in a slot, whose derivatives are there: value, remainder, how far it strays."""
    reach = 0.0
    for i in use:
        reach += abs(terms.slope[slot, i]) * half[i]
    terms.value[slot, 0] = value
    terms.value[slot, 1] = remainder * TAYLOR_INFLATION + ROW_PADDING * (abs(value) + reach)
    terms.value[slot, 2] = reach * TAYLOR_INFLATION + terms.value[slot, 1]


@inner
def product(slot, a, b, half, use, terms):
    """Scalar product of two directions."""
    for i in use:
        total = 0.0
        for c in range(3):
            total += a.value[c] * b.slope[i, c] + b.value[c] * a.slope[i, c]
        terms.slope[slot, i] = total
    value = a.value[0] * b.value[0] + a.value[1] * b.value[1] + a.value[2] * b.value[2]
    _scalar(slot, value, a.remainder + b.remainder + a.stray * b.stray, half, use, terms)


@inner
def triple(slot, a, b, c, half, use, terms):
    """a . (b x c) of three directions."""
    u, v, w = a.value, b.value, c.value
    vw0, vw1, vw2 = v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]
    wu0, wu1, wu2 = w[1] * u[2] - w[2] * u[1], w[2] * u[0] - w[0] * u[2], w[0] * u[1] - w[1] * u[0]
    uv0, uv1, uv2 = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    for i in use:
        terms.slope[slot, i] = (
            a.slope[i, 0] * vw0 + a.slope[i, 1] * vw1 + a.slope[i, 2] * vw2
            + b.slope[i, 0] * wu0 + b.slope[i, 1] * wu1 + b.slope[i, 2] * wu2
            + c.slope[i, 0] * uv0 + c.slope[i, 1] * uv1 + c.slope[i, 2] * uv2
        )  # fmt: skip
    both = a.stray * b.stray + b.stray * c.stray + a.stray * c.stray
    value = u[0] * vw0 + u[1] * vw1 + u[2] * vw2
    error = a.remainder + b.remainder + c.remainder + both + a.stray * b.stray * c.stray
    _scalar(slot, value, error, half, use, terms)


@inner
def _combine(slot, term, other, constant, half, use, terms):
    """Slot = f (x y) + g z + constant, term: (f, x, y), other: (g, z), of slots x, y, z; z may be -1."""
    f, x, y = term
    g, z = other
    value, slope = terms.value, terms.slope
    for i in use:
        total = f * (value[x, 0] * slope[y, i] + value[y, 0] * slope[x, i])
        if z >= 0:  # which may be the slot itself
            total += g * slope[z, i]
        slope[slot, i] = total
    error = abs(f) * (abs(value[x, 0]) * value[y, 1] + abs(value[y, 0]) * value[x, 1] + value[x, 2] * value[y, 2])
    total = f * value[x, 0] * value[y, 0] + constant
    if z >= 0:
        error += abs(g) * value[z, 1]
        total += g * value[z, 0]
    _scalar(slot, total, error, half, use, terms)


@inner
def agree(hand, tolerance, box, use, terms):
    """Narrow by: two angles agree up to the tolerance. False if impossible.

    hand: slot of the hand's cosine. With c the object's cosine and s = sqrt(1 - c^2) <=
    s0 / 2 + (1 - c^2) / (2 s0), the hand's must lie between c cos(tolerance) -+ s sin(tolerance).
    """
    value, slope, own = terms.value, terms.slope, hand + OBJECT_OFFSET
    c = value[own, 0]
    ends = max(-1.0, min(1.0, c - value[own, 2])), max(-1.0, min(1.0, c + value[own, 2]))
    most, least = np.arccos(ends[0]) + 1e-7, np.arccos(ends[1]) - 1e-7
    if tolerance <= 0:
        for i in use:
            slope[ROW, i] = slope[hand, i] - slope[own, i]
        error = value[hand, 1] + value[own, 1]
        return narrow(value[hand, 0] - c, slope[ROW], -error, error, box, use)
    s0 = np.sqrt(max(1e-4, 1 - c * c))
    cosine, sine = np.cos(tolerance), np.sin(tolerance)
    error = value[hand, 1] + value[own, 1] * abs(cosine) + ROW_PADDING
    # s <= s0 / 2 + (1 - c^2) / (2 s0): value, derivative and remainder
    s = 0.5 * s0 + (1 - c * c) / (2 * s0)
    error += abs(sine) * (abs(c) * value[own, 1] + value[own, 2] * value[own, 2]) / s0
    for side in range(2):
        if (side == 0 and most + tolerance >= np.pi) or (side == 1 and least <= tolerance):
            continue
        sign = 1.0 if side == 0 else -1.0
        for i in use:
            slope[ROW, i] = sign * (slope[hand, i] - cosine * slope[own, i]) - sine * c / s0 * slope[own, i]
        gap = sign * (value[hand, 0] - cosine * c) + sine * s
        if not narrow(gap, slope[ROW], -np.inf, error, box, use):
            return False
    return True


@inner
def _balance(a, b, p2, q2, pq):
    """The weight w in [0, 1] for which w a + (1 - w) b + |w p + (1 - w) q| is least (it is convex)."""
    left, right = 0.0, 1.0
    for _ in range(14):
        w = 0.5 * (left + right)
        v = 1 - w
        size = np.sqrt(max(1e-30, w * w * p2 + v * v * q2 + 2 * w * v * pq))
        if a - b + (w * p2 - v * q2 + (v - w) * pq) / size > 0:
            right = w
        else:
            left = w
    return 0.5 * (left + right)


@inner
def twist(tolerance_i, tolerance_j, box, use, terms):
    """Narrow by: one spin of the object about a line suits two directions i and j. False if impossible.

    From slots LINE_I, LINE_J, I_J and TRIPLE. For any weights w_i + w_j = 1 the spins satisfy, at
    best, with p and q the parts across the line multiplied as complex numbers,

        w_i c_i + w_j c_j + |w_i p + w_j q| >= w_i cos(tolerance_i) + w_j cos(tolerance_j).
    """
    value = terms.value
    ai, aj, oi, oj = LINE_I, LINE_J, LINE_I + OBJECT_OFFSET, LINE_J + OBJECT_OFFSET
    a, b, c, d = value[ai, 0], value[aj, 0], value[oi, 0], value[oj, 0]
    across_hand, across_own = value[I_J, 0] - a * b, value[I_J + OBJECT_OFFSET, 0] - c * d
    p2, q2 = (1 - a * a) * (1 - c * c), (1 - b * b) * (1 - d * d)
    pq = across_hand * across_own + value[TRIPLE, 0] * value[TRIPLE + OBJECT_OFFSET, 0]
    ci, cj = a * c - np.cos(tolerance_i), b * d - np.cos(tolerance_j)
    w = _balance(ci, cj, p2, q2, pq)
    v = 1 - w
    n2 = w * w * p2 + v * v * q2 + 2 * w * v * pq
    if not n2 > 1e-8 or w * ci + v * cj + np.sqrt(n2) > 0:
        return True
    n0 = np.sqrt(n2)
    f = 1 / (2 * n0)
    half = box.half
    _combine(8, (-1.0, ai, aj), (1.0, I_J), 0.0, half, use, terms)
    _combine(9, (-1.0, oi, oj), (1.0, I_J + OBJECT_OFFSET), 0.0, half, use, terms)
    _combine(10, (1.0, 8, 9), (0.0, -1), 0.0, half, use, terms)
    _combine(10, (1.0, TRIPLE, TRIPLE + OBJECT_OFFSET), (1.0, 10), 0.0, half, use, terms)
    _combine(11, (-1.0, ai, ai), (0.0, -1), 1.0, half, use, terms)
    _combine(12, (-1.0, oi, oi), (0.0, -1), 1.0, half, use, terms)
    _combine(13, (f * w * w, 11, 12), (2 * f * w * v, 10), 0.5 * n0, half, use, terms)
    _combine(11, (-1.0, aj, aj), (0.0, -1), 1.0, half, use, terms)
    _combine(12, (-1.0, oj, oj), (0.0, -1), 1.0, half, use, terms)
    _combine(14, (f * v * v, 11, 12), (1.0, 13), 0.0, half, use, terms)
    _combine(13, (w, ai, oi), (1.0, 14), 0.0, half, use, terms)
    _combine(14, (v, aj, oj), (1.0, 13), -w * np.cos(tolerance_i) - v * np.cos(tolerance_j), half, use, terms)
    return narrow(value[14, 0], terms.slope[14], -np.inf, value[14, 1], box, use)
