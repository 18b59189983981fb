"""The rows of a node's program by name, compiled: one 64-bit id says what a row is, and makes it on the fly.

Every row is a . z >= b over the reduced unknowns z (`reduced`). It combines a few *base values*, affine in z:

    contact i    values 6i .. 6i+5         c_n, c_t1, c_t2, d_n, d_t1, d_t2
    actuator j   values 6m+3j .. 6m+3j+2   t, excess f - f_c (if its command is sought: f), effort left
    plain k      values 6m+3a+k            with bounds lo[k], hi[k]: the objective, motions, limits; last, unbounded
                                           and only where they are used: the energy that the disturbance and fixed
                                           commands put in, and that of commands per unit of the objective

An id holds kind, index and two angles, so that a working set of ids is all a node has to keep, and a parent's
working set is legal in every child. Angles are integers, `TURN` to a turn. The kinds and what they say are
those of `stability/certificate`; BOX rows bound z itself and give the first working set. The ENERGY row of node k
is the tangent, at the point of k, of the balance of energy: sum c_n^2 <= w . r + f_c . t.
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
ENERGY = 24  # of the node whose number, within the mask NODE, takes the place of the angles

# what a contact is in a node
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = 0, 1, 2, 3, 4
# what an actuator is in a node
FREE, LOCKED, MOVES = 0, 1, 2


KIND, INDEX, ANGLE = 58, 50, 25  # places of the fields in an id; the second angle is at 0
NODE = (1 << INDEX) - 1


def inner(function: Any) -> Any:
    """Compiled, for compiled callers only."""
    return njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


def quick(function: Any) -> Any:
    """The same, sums in any order: for what is checked afterwards."""
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "fastmath": {"reassoc", "contract"}}
    return njit(cache=True, nogil=True, error_model="numpy", **options)(function)


@inner
def place(id, m, nb, plain):  # type: ignore[no-untyped-def]
    """The first base value that a row combines, and how many it may; of nb, the last `plain` ones are plain."""
    kind = id >> KIND
    i = (id >> INDEX) & 255
    if kind < T_UP:
        return 6 * i, 6
    if kind <= S_UP:
        return 6 * m + 3 * i, 3
    return nb - plain + i, 1


@inner
def row(id, m, cos, sin, B, off, mu, lo, hi, box, data, out, g):  # type: ignore[no-untyped-def]
    """Coefficients of a named row into `out` (n,), over its base values into g (6,); returns b of out . z >= b.

    B (base values, n): the base values' coefficients, off: their constants. sin, cos: of the uncertainty of
    the normals, equation (17). data: points of the nodes, and above which objective they were made.
    """
    kind = id >> KIND
    i = (id >> INDEX) & 255
    n = out.shape[0]
    if kind == ENERGY:
        at = id & NODE
        last = off.shape[0] - 1
        rhs = -off[last - 1] - data[at, n] * off[last]
        for j in range(n):
            out[j] = B[last - 1, j] + data[at, n] * B[last, j]
        for k in range(0, 6 * m, 6):
            cn = off[k]
            for j in range(n):
                cn += B[k, j] * data[at, j]
            rhs += cn * (2.0 * off[k] - cn)
            for j in range(n):
                out[j] -= 2.0 * cn * B[k, j]
        return rhs
    if kind >= BOX_UP:
        for j in range(n):
            out[j] = 0.0
        out[i] = 1.0 if kind == BOX_UP else -1.0
        return -box[i]
    for k in range(6):
        g[k] = 0.0
    rhs = 0.0
    xa = ya = xb = yb = 0.0
    h = 1.0
    if kind < T_UP and (sin > 0.0 or (kind >= TANGENT and kind < STILL)):
        turn = 2 * np.pi / TURN
        a = ((id >> ANGLE) & (2 * TURN - 1)) * turn
        b = (id & (2 * TURN - 1)) * turn
        xa = np.cos(a)
        ya = np.sin(a)
        xb = np.cos(b)
        yb = np.sin(b)
        h = 1.0 + xa * xb + ya * yb
    if kind == CN_UP:
        g[0] = 1.0
    elif kind == CN_DOWN:
        g[0] = -1.0
    elif kind == GAP_UP:
        g[0] = 1.0
        g[3] = cos
        g[4] = -sin * (xa + xb) / h
        g[5] = -sin * (ya + yb) / h
    elif kind == GAP_DOWN:
        g[0] = -1.0
        g[3] = -cos
        g[4] = sin * xa
        g[5] = sin * ya
    elif kind == DN_UP:
        g[3] = cos
        g[4] = -sin * (xa + xb) / h
        g[5] = -sin * (ya + yb) / h
    elif kind == TANGENT:
        g[0] = mu[i]
        g[1] = -xa
        g[2] = -ya
    elif kind == CHORD:
        g[0] = -0.5 * mu[i] * h
        g[1] = 0.5 * (xa + xb)
        g[2] = 0.5 * (ya + yb)
    elif kind == C_LEFT:
        g[1] = -ya
        g[2] = xa
    elif kind == C_RIGHT:
        g[1] = yb
        g[2] = -xb
    elif kind == D_LEFT:
        g[4] = ya
        g[5] = -xa
    elif kind == D_RIGHT:
        g[4] = -yb
        g[5] = xb
    elif kind < T_UP:
        s = 1.0 if (kind - STILL) % 2 == 0 else -1.0
        if kind < STILL + 2:
            g[4] = s
        else:
            g[5] = s
    elif kind <= S_UP:
        if kind <= T_DOWN:
            g[0] = 1.0 if kind == T_UP else -1.0
        elif kind <= E_DOWN:
            g[1] = 1.0 if kind == E_UP else -1.0
        else:
            g[2] = 1.0
    else:
        g[0] = 1.0 if kind == PLAIN_UP else -1.0
        rhs = lo[i] if kind == PLAIN_UP else -hi[i]
    first, count = place(id, m, off.shape[0], lo.shape[0])
    for j in range(n):
        out[j] = 0.0
    for k in range(count):
        x = g[k]
        if x != 0.0:
            rhs -= x * off[first + k]
            for j in range(n):
                out[j] += x * B[first + k, j]
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
