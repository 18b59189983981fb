"""Boxes and linear rows with intervals, compiled: what the searches for a contradiction narrow boxes by."""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.taylor import TAYLOR_INFLATION
from handfast.synthesis.task_groups import CAP_REGION

ROW_PADDING = 1e-12  # of the sizes that meet in a row: far more than a few hundred roundings
REPEAT_SHARE = 0.7  # a box that has shrunk to this share in some coordinate is looked at again
BOX_LOOKS = 3
RADIAN = 0.3  # units of length that one of a direction counts for when a coordinate is chosen to split


@inner
def narrow(value, gradient, least_error, most_error, box, use):
    """Narrow `box`, a `CenteredBox`, by: value + sum_i gradient_i d_i + error = 0. False if nothing is left.

    The error is between least_error and most_error; use: coordinates.
    """
    low, high = box.low, box.high
    least, most = value + least_error, value + most_error
    size = abs(value)
    for i in use:
        if gradient[i] > 0:
            least += gradient[i] * low[i]
            most += gradient[i] * high[i]
        else:
            least += gradient[i] * high[i]
            most += gradient[i] * low[i]
        size += abs(gradient[i]) * max(abs(low[i]), abs(high[i]))
    pad = ROW_PADDING * size
    least -= pad
    most += pad
    if least > 0 or most < 0:
        return False
    for i in use:
        g = gradient[i]
        if g == 0:
            continue
        if g > 0:
            # the rest is at least least - g low, so that g d <= -(that)
            top, bottom = -(least - g * low[i]) / g, -(most - g * high[i]) / g
        else:
            top, bottom = -(most - g * low[i]) / g, -(least - g * high[i]) / g
        fuzz = 4 * pad / abs(g) + ROW_PADDING * abs(top) + ROW_PADDING * abs(bottom)
        if top + fuzz < high[i]:
            high[i] = top + fuzz
        if bottom - fuzz > low[i]:
            low[i] = bottom - fuzz
        if low[i] > high[i]:
            return False
    return True


@inner
def center(bounds, use, box):
    """Of the coordinates `use` of a box (n, 2): middle, half widths, and ends about the middle."""
    for i in use:
        middle = 0.5 * (bounds[i, 0] + bounds[i, 1])
        box.middle[i] = middle
        box.half[i] = max(bounds[i, 1] - middle, middle - bounds[i, 0]) * TAYLOR_INFLATION
        box.low[i], box.high[i] = -box.half[i], box.half[i]


@inner
def cut(bounds, use, box):
    """Cut a box (n, 2) to what `narrow` left; the share that is left of the side that shrank most, -1: nothing."""
    shrunk = 1.0
    for i in use:
        width = bounds[i, 1] - bounds[i, 0]
        if width <= 0:
            continue
        low, high = box.middle[i] + box.low[i], box.middle[i] + box.high[i]
        fuzz = 4e-16 * (abs(low) + abs(high) + box.half[i])
        bounds[i, 0] = max(bounds[i, 0], low - fuzz)
        bounds[i, 1] = min(bounds[i, 1], high + fuzz)
        if bounds[i, 0] > bounds[i, 1]:
            return -1.0
        shrunk = min(shrunk, (bounds[i, 1] - bounds[i, 0]) / width)
    return shrunk


@inner
def halve(stack, count, split):
    """Box `count` of the stack in two along a coordinate: itself and the one behind it, each with half its share."""
    box, second = stack.box[count], stack.box[count + 1]
    middle = 0.5 * (box[split, 0] + box[split, 1])
    stack.share[count] *= 0.5
    stack.share[count + 1] = stack.share[count]
    _copy(box, second)
    box[split, 0] = middle
    second[split, 1] = middle


@inner
def set_aside(stack, count, small):
    """Box `count` of the stack, which has come to the resolution, behind the other small ones."""
    _copy(stack.box[count], stack.small[small])
    stack.small_share[small] = stack.share[count]


@inner
def _copy(box, out):
    """A box (n, 2) into another; assigning it whole compiles the texts of numpy's errors for 8 s."""
    for i in range(box.shape[0]):
        out[i, 0], out[i, 1] = box[i, 0], box[i, 1]


@inner
def tolerance_of(k, regions):
    """Largest angle [rad] between the hand's and the object's direction at contact k: of a cap; 0 of a patch."""
    if regions.hand[k] != CAP_REGION:
        return 0.0
    return np.pi if regions.cone[k] <= -1 else np.arccos(regions.cone[k]) + ROW_PADDING


@inner
def angle(a, b):
    """Between two vectors, accurate also near 0 and pi."""
    c0, c1, c2 = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.arctan2(np.sqrt(c0 * c0 + c1 * c1 + c2 * c2), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@inner
def swept(length, dev):
    """Largest angle between a vector of a length and one that differs by at most dev."""
    if dev >= 0.999 * length:
        return np.pi
    return (
        dev / np.sqrt(length * length - dev * dev) * TAYLOR_INFLATION + ROW_PADDING
    )  # the tangent, more than the angle
