"""The conditions of a contact for a box of poses, as linear rows with intervals, compiled.

Taylor polynomials of `object_pose.gaps` about the middle of the box say by how much the points of hand and object miss
each other and their directions differ; each function narrows the box by what must be zero.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.narrowing import RADIAN, ROW_PADDING, angle, narrow, swept
from handfast.synthesis.search.kernel.object_pose import cosine_of_directions
from handfast.synthesis.search.kernel.taylor import (
    HAND_DIRECTION,
    HAND_POINT,
    OBJECT_DIRECTION,
    OBJECT_POINT,
    TAYLOR_INFLATION,
    TAYLOR_ROUNDING,
    norm,
    spread,
)


@inner
def points_meet(k, use, theta, curve, position, chains, work):
    """Narrow by: the points coincide. theta, curve: as from `gaps`; position: first coordinate of the object's.

    Returns (False if impossible, remainder of the way between them, the same without the hand's).
    """
    box, gradient, y, z = work.box, work.turned.gradient, work.turned.point, work.turned.direction
    value, slope, remainder = work.polynomials.value[0], work.polynomials.slope[0], work.polynomials.remainder[0]
    stray = spread(slope[OBJECT_POINT], box.half, use) + remainder[OBJECT_POINT]
    others = (remainder[OBJECT_POINT] + curve * norm(y) + theta * stray + TAYLOR_ROUNDING) * TAYLOR_INFLATION
    error = (remainder[HAND_POINT] + others) * TAYLOR_INFLATION
    along, way = 0.0, work.turned.offset
    for c in range(3):
        gap = value[HAND_POINT, c] - y[c] - box.middle[position + c]
        along += z[c] * gap
        way[:] = 0.0
        way[c] = 1.0
        low, high = _bow(k, way, chains, work)
        if not narrow(gap, gradient[c], max(low - others, -error), min(high + others, error), box, use):
            return False, error, others
    # along the normal, where the parameters of the region drop out
    for i in use:
        gradient[6, i] = z[0] * gradient[0, i] + z[1] * gradient[1, i] + z[2] * gradient[2, i]
    low, high = _bow(k, z, chains, work)
    fits = narrow(
        along, gradient[6], max(low - others, -error) - ROW_PADDING, min(high + others, error) + ROW_PADDING, box, use
    )
    return fits, error, others


@inner
def _bow(k, way, chains, work):
    """Bounds of what the polynomial of degree one of the hand's point leaves out along a vector (3,)."""
    bend, half, low, high = work.polynomials.bend[0], work.box.half, 0.0, 0.0
    for i in range(chains.joints[k]):
        v = chains.coordinate[k, i]
        for j in range(i, chains.joints[k]):
            w = chains.coordinate[k, j]
            value = way[0] * bend[i, j, 0] + way[1] * bend[i, j, 1] + way[2] * bend[i, j, 2]
            value *= (0.5 if i == j else 1.0) * half[v] * half[w]
            low += min(value, 0.0) if v == w else -abs(value)
            high += max(value, 0.0) if v == w else abs(value)
    rest = work.polynomials.rest[0] * norm(way) * TAYLOR_INFLATION
    return low - rest, high + rest


@inner
def directions_meet(tolerance, use, theta, curve, work):
    """Narrow by: the directions of hand and object agree up to the tolerance. theta, curve: as from `gaps`.

    Returns (False if impossible, remainder: of the directions, or of a cap's cosine; -1 if there is no condition).
    """
    box, gradient, z = work.box, work.turned.gradient, work.turned.direction
    value, slope, remainder = work.polynomials.value[0], work.polynomials.slope[0], work.polynomials.remainder[0]
    turned = spread(slope[OBJECT_DIRECTION], box.half, use) + remainder[OBJECT_DIRECTION]
    both = remainder[HAND_DIRECTION] + remainder[OBJECT_DIRECTION]
    error = (both + curve + theta * turned + TAYLOR_ROUNDING) * TAYLOR_INFLATION
    if tolerance <= 0:
        for c in range(3):
            if not narrow(value[HAND_DIRECTION, c] - z[c], gradient[3 + c], -error, error, box, use):
                return False, error
        return True, error
    if tolerance < np.pi:
        tilt = spread(slope[HAND_DIRECTION], box.half, use) + remainder[HAND_DIRECTION]
        off, gap = swept(1.0, tilt) + swept(1.0, turned) + theta, angle(value[HAND_DIRECTION], z)
        if gap - off > tolerance + ROW_PADDING:
            return False, error
        if gap + off > tolerance:
            error = (error + tilt * (turned + theta)) * TAYLOR_INFLATION
            over = cosine_of_directions(use, work) - np.cos(tolerance)
            return narrow(over, gradient[3], -np.inf, error, box, use), error
    return True, -1.0


@inner
def not_apart(k, use, position, errors, task, work):
    """Narrow by the rows of the two functions above, multiplied by factors and added up. False if impossible.

    The factors are what the rows still are where a Newton step, cut off at the ends of the box, brings them nearest to
    zero together. If they cannot all be zero, their sum is then about the one that shows it best; but whatever the
    factors, the sum is a row. That of a cap's cosine may be positive: its factor is not, and the sum has only an upper
    end. errors: all three remainders, as both functions return them.
    """
    box, here, newton, tolerance = work.box, work.turned, work.inner.newton, work.polynomials.tolerance[k]
    gradient, step, side = here.gradient, here.step, here.side
    points, others, directions = errors
    rows = 3 if directions < 0 else _active(tolerance, work)
    _values(tolerance, rows, position, work)
    for i in use:
        side[i] = 0.5 * (box.high[i] - box.low[i])
    least_step(newton, rows, side, use, gradient)
    for i in use:
        step[i] = 0.0
        for a in range(rows):
            step[i] -= newton[a, 6] * gradient[a, i]
        step[i] = min(max(step[i] * side[i] * side[i], box.low[i]), box.high[i])
    _values(tolerance, rows, position, work)
    value, near, far, size = 0.0, 0.0, 0.0, 0.0
    for a in range(rows):
        left, weight = newton[a, 6], 1.0 if a < 3 else RADIAN * RADIAN
        for i in use:
            left += gradient[a, i] * step[i]
        if rows == 4 and a == 3:
            left = min(left, 0.0)
        left *= weight
        value += left * newton[a, 6]
        newton[a, 6] = left
        if a < 3:
            near += left * left
        else:
            far += left * left
    size = np.sqrt(near + far)
    if size <= others:
        return True
    for i in use:
        total = 0.0
        for a in range(rows):
            total += newton[a, 6] * gradient[a, i]
        gradient[6, i] = total / size
    for c in range(3):
        here.offset[c] = newton[c, 6]
    low, _ = _bow(k, here.offset, task.chains, work)
    error = (min(np.sqrt(near) * points, np.sqrt(near) * others - low) + np.sqrt(far) * max(directions, 0.0)) / size
    return narrow(value / size, gradient[6], -(error + TAYLOR_ROUNDING) * TAYLOR_INFLATION, np.inf, box, use)


@inner
def _active(tolerance, work):
    """How many rows of a contact count in the middle of the box: a cap's cosine does where it is too small."""
    if tolerance <= 0:
        return 6
    a, z = work.polynomials.value[0, HAND_DIRECTION], work.turned.direction
    return 4 if a[0] * z[0] + a[1] * z[1] + a[2] * z[2] < np.cos(tolerance) else 3


@inner
def _values(tolerance, rows, position, work):
    """What so many rows of a contact are in the middle of `work.box`, into column 6 of work.inner.newton."""
    value, here, newton = work.polynomials.value[0], work.turned, work.inner.newton
    for c in range(3):
        newton[c, 6] = value[HAND_POINT, c] - here.point[c] - work.box.middle[position + c]
        if rows == 6:
            newton[3 + c, 6] = value[HAND_DIRECTION, c] - here.direction[c]
    if rows == 4:
        a, z = value[HAND_DIRECTION], here.direction
        newton[3, 6] = a[0] * z[0] + a[1] * z[1] + a[2] * z[2] - np.cos(tolerance)


@inner
def least_step(matrix, rows, side, use, gradient):
    """Solve (A S^2 A') a = r with A the rows of `gradient`, S = side, r in column 6 of `matrix`, where a goes."""
    for a in range(rows):
        for b in range(a + 1):
            total = 0.0
            for i in use:
                total += gradient[a, i] * gradient[b, i] * side[i] * side[i]
            matrix[a, b] = matrix[b, a] = total
    for a in range(rows):
        matrix[a, a] += 1e-9 * matrix[a, a] + 1e-15
    for a in range(rows):
        for b in range(a + 1, rows):
            f = matrix[b, a] / matrix[a, a]
            for c in range(a, rows):
                matrix[b, c] -= f * matrix[a, c]
            matrix[b, 6] -= f * matrix[a, 6]
    for back in range(rows):
        a = rows - 1 - back
        for c in range(a + 1, rows):
            matrix[a, 6] -= matrix[a, c] * matrix[c, 6]
        matrix[a, 6] /= matrix[a, a]
