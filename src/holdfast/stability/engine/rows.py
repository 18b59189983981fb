"""The rows of a node's program by name, compiled: one 64-bit id says what a row is, and makes it on the fly.

Every row is a . z >= b over the reduced unknowns z (`reduced`), of which the first nu are motions, the others
forces. It combines a few *base values*, affine in z: forces c = C z + off and motions d = D z.

    contact i    c[3i], c[3i+1], c[3i+2]: c_n, c_t1, c_t2    d[3i], d[3i+1], d[3i+2]: d_n, d_t1, d_t2
    actuator j   c[3m+2j]: the excess f - f_c (if its command is sought: f), c[3m+2j+1]: effort left    d[3m+j]: t
    plain k      with bounds lo[k], hi[k]: c from 3m + 2a on, the objective and limits of forces, F values in all;
                 then d from 3m + a on, motions; last, unbounded and only where they are used, the energy that the
                 disturbance and fixed commands put in, and that of commands per unit of the objective

An id holds kind, index and two angles, so that a working set of ids is all a node has to keep, and a parent's
working set is legal in every child. Angles are integers, `TURN` to a turn. The kinds and what they say are
those of `stability/certificate`; BOX rows bound z itself and give the first working set. The ENERGY row of node k
is the tangent, at the point of k, of the balance of energy: sum c_n^2 <= w . r + f_c . t.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numba.core import cgutils
from numba.extending import intrinsic

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
VECTOR = 4  # numbers that the processor takes at once


def vectors(n: int) -> int:
    """So many numbers that whole vectors of the processor hold n of them."""
    return n + -n % VECTOR


def inner(function: Any) -> Any:
    """Compiled, for compiled callers only."""
    return njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)


def quick(function: Any) -> Any:
    """The same, sums in any order: for what is checked afterwards."""
    options = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "fastmath": {"reassoc", "contract"}}
    return njit(cache=True, nogil=True, error_model="numpy", **options)(function)


@quick
def larger(a, b):  # type: ignore[no-untyped-def]
    """Of two numbers; `max` is a call that is not inlined."""
    return a if a > b else b


@quick
def smaller(a, b):  # type: ignore[no-untyped-def]
    return a if a < b else b


@intrinsic
def bare(typing, arrays):  # type: ignore[no-untyped-def]
    """A tuple of arrays without their owners: the caller keeps them alive, and no call counts references.

    Counting is atomic, a quarter of the kernel's time, and more where two threads share the arrays.
    """

    def code(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        views = []
        for k, kind in enumerate(arrays.types):
            view = context.make_array(kind)(context, builder, builder.extract_value(arguments[0], k))
            view.meminfo = cgutils.get_null_value(view.meminfo.type)
            view.parent = cgutils.get_null_value(view.parent.type)
            views.append(view._getvalue())
        return context.make_tuple(builder, arrays, views)

    return arrays(arrays), code


@quick
def row(id, m, a, F, cos, sin, C, D, off, mu, lo, hi, box, data, out, g):  # type: ignore[no-untyped-def]
    """Coefficients of a named row into `out` (n,), over its base values into g (6,); returns b of out . z >= b.

    C (forces, n), D (motions, n): the base values' coefficients, off: the forces' constants. sin, cos: of the
    uncertainty of the normals, equation (17). data: points of the nodes, and above which objective they were made.
    """
    kind = id >> KIND
    i = (id >> INDEX) & 255
    n = out.shape[0]
    for j in range(n):
        out[j] = 0.0
    if kind == ENERGY:
        at = id & NODE
        last = D.shape[0] - 1
        rhs = 0.0
        for j in range(n):
            out[j] = D[last - 1, j] + data[at, n] * D[last, j]
        for k in range(0, 3 * m, 3):
            cn = off[k]
            for j in range(n):
                cn += C[k, j] * data[at, j]
            rhs += cn * (2.0 * off[k] - cn)
            for j in range(n):
                out[j] -= 2.0 * cn * C[k, j]
        return rhs
    if kind >= BOX_UP:
        out[i] = 1.0 if kind == BOX_UP else -1.0
        return -box[i]
    for k in range(6):
        g[k] = 0.0
    rhs = 0.0
    xa = ya = xb = yb = 0.0
    h = 1.0
    if kind < T_UP and (sin > 0.0 or (kind >= TANGENT and kind < STILL)):
        turn = 2 * np.pi / TURN
        left = ((id >> ANGLE) & (2 * TURN - 1)) * turn
        right = (id & (2 * TURN - 1)) * turn
        xa = np.cos(left)
        ya = np.sin(left)
        xb = np.cos(right)
        yb = np.sin(right)
        h = 1.0 + xa * xb + ya * yb
    force = 3 * i  # the first of the values that it combines
    motion = 3 * i
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
        force = 3 * m + 2 * i
        motion = 3 * m + i
        if kind <= T_DOWN:
            g[3] = 1.0 if kind == T_UP else -1.0
        elif kind <= E_DOWN:
            g[0] = 1.0 if kind == E_UP else -1.0
        else:
            g[1] = 1.0
    else:
        force = 3 * m + 2 * a + i
        motion = 3 * m + a + force - F
        g[0 if force < F else 3] = 1.0 if kind == PLAIN_UP else -1.0
        rhs = lo[i] if kind == PLAIN_UP else -hi[i]
    for k in range(3):
        x = g[k]
        if x != 0.0:
            rhs -= x * off[force + k]
            for j in range(n):
                out[j] += x * C[force + k, j]
        x = g[3 + k]
        if x != 0.0:
            for j in range(n):
                out[j] += x * D[motion + k, j]
    return rhs


@quick
def blend(x, first, rows, out):  # type: ignore[no-untyped-def]
    """out += x rows, of x from `first` on; four rows at a time."""
    n = rows.shape[0]
    for j in range(0, n - 3, 4):
        a = x[first + j]
        b = x[first + j + 1]
        c = x[first + j + 2]
        d = x[first + j + 3]
        for k in range(out.shape[0]):
            out[k] += a * rows[j, k] + b * rows[j + 1, k] + c * rows[j + 2, k] + d * rows[j + 3, k]
    for j in range(n & ~3, n):
        a = x[first + j]
        for k in range(out.shape[0]):
            out[k] += a * rows[j, k]


@quick
def values(CT, DT, off, z, c, d):  # type: ignore[no-untyped-def]
    """The base values of a point z, forces into c, motions into d."""
    for k in range(c.shape[0]):
        c[k] = off[k]
    for k in range(d.shape[0]):
        d[k] = 0.0
    blend(z, 0, DT, d)
    blend(z, DT.shape[0], CT, c)
