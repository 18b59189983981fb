"""The rows of a node's program by name, compiled: one 64-bit id says what a row is, and makes it on the fly.

Every row is a . z >= b over the reduced unknowns z (`reduced`). It combines a few *base values*, affine in z:

    contact i    values 6i .. 6i+5         c_n, c_t1, c_t2, d_n, d_t1, d_t2
    actuator j   values 6m+3j .. 6m+3j+2   t, excess f - f_c (if its command is sought: f), effort left
    plain k      values 6m+3a+k            with bounds lo[k], hi[k]: the objective, motions, limits

An id holds kind, index and two angles, so that a working set of ids is all a node has to keep, and a parent's
working set is legal in every child. Angles are integers, `TURN` to a turn. The kinds and what they say are
those of `stability/certificate`; BOX rows bound z itself and give the first working set.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

TURN = 1 << 24

# kinds of rows, see `row`
CN_UP, CN_DOWN, GAP_UP, GAP_DOWN, DN_UP, TANGENT, CHORD = 0, 1, 2, 3, 4, 5, 6
C_LEFT, C_RIGHT, D_LEFT, D_RIGHT = 7, 8, 9, 10
STILL = 11  # to 14: +d_t1, -d_t1, +d_t2, -d_t2
T_UP, T_DOWN, E_UP, E_DOWN, S_UP, PLAIN_UP, PLAIN_DOWN, BOX_UP, BOX_DOWN = 15, 16, 17, 18, 19, 20, 21, 22, 23

# what a contact is in a node
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = 0, 1, 2, 3, 4
# what an actuator is in a node
FREE, LOCKED, MOVES = 0, 1, 2


KIND, INDEX, ANGLE = 58, 50, 25  # places of the fields in an id; the second angle is at 0


def inner(function: Any) -> Any:
    """Compiled, for compiled callers only."""
    return njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


def quick(function: Any) -> Any:
    """The same, sums in any order: for what is checked afterwards."""
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "fastmath": {"reassoc", "contract"}}
    return njit(cache=True, nogil=True, error_model="numpy", **options)(function)


@inner
def row(id, m, cos, sin, B, off, mu, lo, hi, box, out):  # type: ignore[no-untyped-def]
    """Coefficients of a named row into `out` (n,); returns b of out . z >= b.

    B (base values, n): the base values' coefficients, off: their constants. sin, cos: of the uncertainty of
    the normals, equation (17).
    """
    kind = id >> KIND
    i = (id >> INDEX) & 255
    n = out.shape[0]
    if kind >= BOX_UP:
        for j in range(n):
            out[j] = 0.0
        out[i] = 1.0 if kind == BOX_UP else -1.0
        return -box[i]
    g0 = g1 = g2 = g3 = g4 = g5 = rhs = 0.0
    first = 6 * i
    count = 6
    turn = 2 * np.pi / TURN
    a = ((id >> ANGLE) & (2 * TURN - 1)) * turn
    b = (id & (2 * TURN - 1)) * turn
    xa = np.cos(a)
    ya = np.sin(a)
    xb = np.cos(b)
    yb = np.sin(b)
    h = 1.0 + xa * xb + ya * yb
    if kind == CN_UP:
        g0 = 1.0
    elif kind == CN_DOWN:
        g0 = -1.0
    elif kind == GAP_UP:
        g0 = 1.0
        g3 = cos
        g4 = -sin * (xa + xb) / h
        g5 = -sin * (ya + yb) / h
    elif kind == GAP_DOWN:
        g0 = -1.0
        g3 = -cos
        g4 = sin * xa
        g5 = sin * ya
    elif kind == DN_UP:
        g3 = cos
        g4 = -sin * (xa + xb) / h
        g5 = -sin * (ya + yb) / h
    elif kind == TANGENT:
        g0 = mu[i]
        g1 = -xa
        g2 = -ya
    elif kind == CHORD:
        g0 = -0.5 * mu[i] * h
        g1 = 0.5 * (xa + xb)
        g2 = 0.5 * (ya + yb)
    elif kind == C_LEFT:
        g1 = -ya
        g2 = xa
    elif kind == C_RIGHT:
        g1 = yb
        g2 = -xb
    elif kind == D_LEFT:
        g4 = ya
        g5 = -xa
    elif kind == D_RIGHT:
        g4 = -yb
        g5 = xb
    elif kind < T_UP:
        s = 1.0 if (kind - STILL) % 2 == 0 else -1.0
        if kind < STILL + 2:
            g4 = s
        else:
            g5 = s
    elif kind <= S_UP:
        first = 6 * m + 3 * i
        count = 3
        if kind <= T_DOWN:
            g0 = 1.0 if kind == T_UP else -1.0
        elif kind <= E_DOWN:
            g1 = 1.0 if kind == E_UP else -1.0
        else:
            g2 = 1.0
    else:
        first = off.shape[0] - lo.shape[0] + i
        count = 1
        g0 = 1.0 if kind == PLAIN_UP else -1.0
        rhs = lo[i] if kind == PLAIN_UP else -hi[i]
    rhs -= g0 * off[first]
    for j in range(n):
        out[j] = g0 * B[first, j]
    if count >= 3:
        rhs -= g1 * off[first + 1] + g2 * off[first + 2]
        for j in range(n):
            out[j] += g1 * B[first + 1, j] + g2 * B[first + 2, j]
    if count == 6:
        rhs -= g3 * off[first + 3] + g4 * off[first + 4] + g5 * off[first + 5]
        for j in range(n):
            out[j] += g3 * B[first + 3, j] + g4 * B[first + 4, j] + g5 * B[first + 5, j]
    return rhs


@inner
def values(BT, off, z, v):  # type: ignore[no-untyped-def]
    """The base values of a point z into v; BT is the transpose of B."""
    for k in range(v.shape[0]):
        v[k] = off[k]
    for j in range(z.shape[0]):
        x = z[j]
        for k in range(v.shape[0]):
            v[k] += x * BT[j, k]
