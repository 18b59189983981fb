"""Ball arithmetic, compiled: a number is (middle, radius) and holds every real within the radius.

Middles are computed in plain floating point; radii bound what that rounds, and are themselves rounded up by
`BALL_INFLATION`, which exceeds the rounding of the few operations between two uses of it. Sines and cosines are taken
to be within two units in the last place of the true ones. With radii of zero on entry the middles are the
ordinary floating-point results. `reals.py` has the same operations on plain numbers: `kinematics.py` is made of either.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner

MOTION_ROUNDING = 2e-15  # of the rigid motions between joints: rounding when they were multiplied together
BALL_ROUNDOFF = 1.12e-16  # one rounding, relative
BALL_INFLATION = 1.0 + 2e-15
UNDERFLOW_BOUND = 1e-290  # more than underflow can lose
CIRCULAR = 5e-16  # error of a sine or cosine


@inner
def exact(x):
    """A float as a ball."""
    return x, 0.0


@inner
def rounded(x):
    """An entry of a rigid motion as a ball."""
    return x, MOTION_ROUNDING


@inner
def add(a, b):
    m = a[0] + b[0]
    return m, (a[1] + b[1] + BALL_ROUNDOFF * abs(m)) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def sub(a, b):
    m = a[0] - b[0]
    return m, (a[1] + b[1] + BALL_ROUNDOFF * abs(m)) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def mul(a, b):
    m = a[0] * b[0]
    return m, (abs(a[0]) * b[1] + a[1] * (abs(b[0]) + b[1]) + BALL_ROUNDOFF * abs(m)) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def scale(c, a):
    """An exact float times a ball."""
    m = c * a[0]
    return m, (abs(c) * a[1] + BALL_ROUNDOFF * abs(m)) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def div(a, b):
    """Radius infinite if the divisor's ball reaches zero."""
    room = (abs(b[0]) - b[1]) * (2.0 - BALL_INFLATION)
    if not room > 0:
        return 0.0, np.inf
    m = a[0] / b[0]
    return m, (
        (a[1] + abs(m) * BALL_INFLATION * b[1]) / room + BALL_ROUNDOFF * abs(m)
    ) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def root(a):
    """Square root; radius infinite if the ball reaches zero."""
    room = (a[0] - a[1]) * (2.0 - BALL_INFLATION)
    if not room > 0:
        return 0.0, np.inf
    m = np.sqrt(a[0])
    return m, (
        a[1] / (np.sqrt(room) * (2.0 - BALL_INFLATION) + m) + BALL_ROUNDOFF * m
    ) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def sine(a):
    return np.sin(a[0]), (min(a[1], 2.0) + CIRCULAR) * BALL_INFLATION


@inner
def cosine(a):
    return np.cos(a[0]), (min(a[1], 2.0) + CIRCULAR) * BALL_INFLATION


@inner
def get(a, i):
    """Ball i of an array (n, 2)."""
    return a[i, 0], a[i, 1]


@inner
def put(a, i, x):
    a[i, 0] = x[0]
    a[i, 1] = x[1]


@inner
def moved(base, row, column):
    """base + row . column, of a row (3, 2) and a column (3,) of a rigid motion."""
    m, r = base
    size = abs(m)
    for j in range(3):
        t = column[j]
        m += row[j, 0] * t
        size += abs(row[j, 0] * t)
        r += row[j, 1] * (abs(t) + MOTION_ROUNDING) + MOTION_ROUNDING * abs(row[j, 0])
    return m, r * BALL_INFLATION + 1e-15 * size


@inner
def dot(a, b):
    """Of two vectors (3, 2)."""
    m = a[0, 0] * b[0, 0] + a[1, 0] * b[1, 0] + a[2, 0] * b[2, 0]
    r, size = 0.0, 0.0
    for i in range(3):
        size += abs(a[i, 0] * b[i, 0])
        r += abs(a[i, 0]) * b[i, 1] + a[i, 1] * (abs(b[i, 0]) + b[i, 1])
    return m, (r + 4 * BALL_ROUNDOFF * size) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def cross(a, b, out):
    """Of two vectors (3, 2) into `out`."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        x, y = a[j, 0] * b[k, 0], a[k, 0] * b[j, 0]
        r = abs(a[j, 0]) * b[k, 1] + a[j, 1] * (abs(b[k, 0]) + b[k, 1])
        r += abs(a[k, 0]) * b[j, 1] + a[k, 1] * (abs(b[j, 0]) + b[j, 1])
        out[i, 0] = x - y
        out[i, 1] = (r + 3 * BALL_ROUNDOFF * (abs(x) + abs(y))) * BALL_INFLATION + UNDERFLOW_BOUND


@inner
def times(R, v, out):
    """Matrix (3, 3, 2) times vector (3, 2) into `out`."""
    for i in range(3):
        x = dot(R[i], v)
        out[i, 0] = x[0]
        out[i, 1] = x[1]
