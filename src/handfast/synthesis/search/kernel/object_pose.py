"""Where a contact can be over a box of the object's poses, compiled: Taylor polynomials of degree one.

The rotation is that of an unnormalised quaternion q. On a straight path of them it turns with the velocity
w = 2 Im(q' conj q) / |q|^2; q' has no second derivative, so that w' is along w, and

    |(R y)''| <= |w| (|w|^2 + (2 q.q' / |q|^2)^2)^(1/2) |y| <= (2 |q'| / |q|)^2 |y|.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.taylor import (
    HAND_DIRECTION,
    HAND_POINT,
    OBJECT_DIRECTION,
    OBJECT_POINT,
    TAYLOR_INFLATION,
    TAYLOR_ROUNDING,
    element,
)
from handfast.synthesis.task_groups import QUATERNION


@inner
def turning(box, first, R, turn):
    """Rotation of the quaternion in a box, coordinates first to first + 3, in its middle: R (3, 3) and turn (4, 3).

    turn: velocities, R y moves by turn_i x R y for a unit of component i. Returns (largest angle between
    a rotation of the box and the middle one, what the polynomial of degree one leaves out for a unit vector).
    """
    x, half = box.middle, box.half
    a, b, c, d = x[first], x[first + 1], x[first + 2], x[first + 3]
    f = 2.0 / (a * a + b * b + c * c + d * d)
    R[0, 0], R[0, 1], R[0, 2] = 1 - f * (c * c + d * d), f * (b * c - a * d), f * (b * d + a * c)
    R[1, 0], R[1, 1], R[1, 2] = f * (b * c + a * d), 1 - f * (b * b + d * d), f * (c * d - a * b)
    R[2, 0], R[2, 1], R[2, 2] = f * (b * d - a * c), f * (c * d + a * b), 1 - f * (b * b + c * c)
    turn[0, 0], turn[0, 1], turn[0, 2] = -f * b, -f * c, -f * d
    turn[1, 0], turn[1, 1], turn[1, 2] = f * a, f * d, -f * c
    turn[2, 0], turn[2, 1], turn[2, 2] = -f * d, f * a, f * b
    turn[3, 0], turn[3, 1], turn[3, 2] = f * c, -f * b, f * a
    far, least = 0.0, 0.0
    for i in range(first, first + 4):
        far += half[i] * half[i]
        gap = max(0.0, abs(x[i]) - half[i])
        least += gap * gap
    bend = 2.0 * far / least * TAYLOR_INFLATION  # half of (2 |q'| / |q|)^2
    return np.sqrt(2.0 * bend) * TAYLOR_INFLATION, bend + TAYLOR_ROUNDING


@inner
def rotated(R, v, out):
    """R v into `out` (3,)."""
    for c in range(3):
        out[c] = R[c, 0] * v[0] + R[c, 1] * v[1] + R[c, 2] * v[2]


@inner
def turn_derivatives(turn, y, sign, first, gradient):
    """Derivatives of sign R y by the quaternion's components, into columns first to first + 3 of gradient (., n)."""
    for j in range(4):
        for c in range(3):
            d, e = (c + 1) % 3, (c + 2) % 3
            gradient[c, first + j] = sign * (turn[j, d] * y[e] - turn[j, e] * y[d])


@inner
def gaps(k, use, task, question, work):
    """Taylor polynomials of contact k about the middle of `work.box`.

    Into work.turned: derivatives of the gap of the points in rows 0 to 2 of the gradient, of the directions in 3 to 5;
    the object's point and direction, turned. Returns (largest turn, remainder of a turn).
    """
    box, polynomials, here = work.box, work.polynomials, work.turned
    R, gradient = here.rotation, here.gradient
    quaternion = task.coordinates.parameter[0] - QUATERNION
    element(k, 0, task, question.derivative_bounds, work)
    theta, curve = turning(box, quaternion, R, here.turn)
    value, slope = polynomials.value[0], polynomials.slope[0]
    for c in range(3):
        here.offset[c] = value[OBJECT_POINT, c] - question.middle[c]
    rotated(R, here.offset, here.point)
    rotated(R, value[OBJECT_DIRECTION], here.direction)
    on_hand, hand_direction = slope[HAND_POINT], slope[HAND_DIRECTION]
    on_object, object_direction = slope[OBJECT_POINT], slope[OBJECT_DIRECTION]
    for i in use:
        for c in range(3):
            r0, r1, r2 = R[c, 0], R[c, 1], R[c, 2]
            gradient[c, i] = on_hand[i, c] - r0 * on_object[i, 0] - r1 * on_object[i, 1] - r2 * on_object[i, 2]
            gradient[3 + c, i] = (
                hand_direction[i, c]
                - r0 * object_direction[i, 0]
                - r1 * object_direction[i, 1]
                - r2 * object_direction[i, 2]
            )
    turn_derivatives(here.turn, here.point, -1.0, quaternion, gradient)
    turn_derivatives(here.turn, here.direction, -1.0, quaternion, gradient[3:])
    for c in range(3):
        gradient[c, quaternion - 3 + c] = -1.0
    return theta, curve


@inner
def cosine_of_directions(use, work):
    """The cosine between the directions, 1 - |a - z|^2 / 2; its derivatives into row 3 of the gradient."""
    a, z, gradient = work.polynomials.value[0, HAND_DIRECTION], work.turned.direction, work.turned.gradient
    d0, d1, d2 = a[0] - z[0], a[1] - z[1], a[2] - z[2]
    for i in use:
        gradient[3, i] = -d0 * gradient[3, i] - d1 * gradient[4, i] - d2 * gradient[5, i]
    return a[0] * z[0] + a[1] * z[1] + a[2] * z[2]
