"""Boxes and linear rows with intervals, compiled: what the searches for a contradiction narrow boxes by."""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.compiled import inner
from handfast.synthesis.search.kernel.contact_equations import PATCH
from handfast.synthesis.search.kernel.taylor import WIDER

PAD = 1e-12  # of the sizes that meet in a row: far more than a few hundred roundings
AGAIN = 0.7  # a box that has shrunk to this share in some coordinate is looked at again
LOOKS = 3
TURN = 0.3  # units of length that a radian of a direction counts for when a coordinate is chosen to split


@inner
def narrow(value, g, lo, hi, low, high, use):  # type: ignore[no-untyped-def]
    """Narrow [low, high] by: value + sum_i g_i d_i + e = 0 for some e in [lo, hi]. False if nothing is left."""
    least, most = value + lo, value + hi
    size = abs(value)
    for i in use:
        if g[i] > 0:
            least += g[i] * low[i]
            most += g[i] * high[i]
        else:
            least += g[i] * high[i]
            most += g[i] * low[i]
        size += abs(g[i]) * max(abs(low[i]), abs(high[i]))
    pad = PAD * size
    least -= pad
    most += pad
    if least > 0 or most < 0:
        return False
    for i in use:
        if g[i] == 0:
            continue
        if g[i] > 0:
            # the rest is at least least - g low, so that g d <= -(that)
            top, bottom = -(least - g[i] * low[i]) / g[i], -(most - g[i] * high[i]) / g[i]
        else:
            top, bottom = -(most - g[i] * low[i]) / g[i], -(least - g[i] * high[i]) / g[i]
        fuzz = 4 * pad / abs(g[i]) + PAD * abs(top) + PAD * abs(bottom)
        if top + fuzz < high[i]:
            high[i] = top + fuzz
        if bottom - fuzz > low[i]:
            low[i] = bottom - fuzz
        if low[i] > high[i]:
            return False
    return True


@inner
def copy(box, out):  # type: ignore[no-untyped-def]
    """A box (n, 2) into another; assigning it whole compiles the texts of numpy's errors for 8 s."""
    for i in range(box.shape[0]):
        out[i, 0], out[i, 1] = box[i, 0], box[i, 1]


@inner
def halve(stack, share, count, split):  # type: ignore[no-untyped-def]
    """Box `count` of the stack in two along a coordinate: itself and the one behind it, each with half its share."""
    middle = 0.5 * (stack[count, split, 0] + stack[count, split, 1])
    share[count] *= 0.5
    share[count + 1] = share[count]
    copy(stack[count], stack[count + 1])
    stack[count, split, 0] = middle
    stack[count + 1, split, 1] = middle


@inner
def cone_of(k, flat):  # type: ignore[no-untyped-def]
    """Largest angle [rad] between the hand's and the object's direction at contact k: of a cap; 0 of a patch."""
    if flat.hand[k] == PATCH:
        return 0.0
    return np.pi if flat.cone[k] <= -1 else np.arccos(flat.cone[k]) + PAD


@inner
def angle(a, b):  # type: ignore[no-untyped-def]
    """Between two vectors, accurate also near 0 and pi."""
    c0, c1, c2 = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.arctan2(np.sqrt(c0 * c0 + c1 * c1 + c2 * c2), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@inner
def swept(length, dev):  # type: ignore[no-untyped-def]
    """Largest angle between a vector of a length and one that differs by at most dev."""
    if dev >= 0.999 * length:
        return np.pi
    return dev / np.sqrt(length * length - dev * dev) * WIDER + PAD  # the tangent, more than the angle


@inner
def center(box, use, x, h, low, high):  # type: ignore[no-untyped-def]
    """Middle and half widths of a box; low and high are its ends about the middle."""
    for i in use:
        middle = 0.5 * (box[i, 0] + box[i, 1])
        x[i] = middle
        h[i] = max(box[i, 1] - middle, middle - box[i, 0]) * WIDER
        low[i], high[i] = -h[i], h[i]


@inner
def taken(box, use, x, h, low, high):  # type: ignore[no-untyped-def]
    """Cut a box to what `narrow` left; the share that is left of the side that shrank most, -1: nothing."""
    shrunk = 1.0
    for i in use:
        width = box[i, 1] - box[i, 0]
        if width <= 0:
            continue
        new_low, new_high = x[i] + low[i], x[i] + high[i]
        fuzz = 4e-16 * (abs(new_low) + abs(new_high) + h[i])
        box[i, 0] = max(box[i, 0], new_low - fuzz)
        box[i, 1] = min(box[i, 1], new_high + fuzz)
        if box[i, 0] > box[i, 1]:
            return -1.0
        shrunk = min(shrunk, (box[i, 1] - box[i, 0]) / width)
    return shrunk
