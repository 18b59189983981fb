"""Rows from their names and base values from points, compiled; see `rows`."""

from __future__ import annotations

import numpy as np

from handfast.stability.search.kernel.compiled import quick
from handfast.stability.search.rows import (
    ANGLE,
    BOX_UP,
    C_LEFT,
    C_RIGHT,
    CHORD,
    CN_DOWN,
    CN_UP,
    D_LEFT,
    D_RIGHT,
    DN_UP,
    E_DOWN,
    E_UP,
    ENERGY,
    GAP_DOWN,
    GAP_UP,
    INDEX,
    KIND,
    NODE,
    PLAIN_UP,
    S_UP,
    STILL,
    T_DOWN,
    T_UP,
    TANGENT,
    TURN,
    WIDER,
)


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
        g[4] = -sin * (1.0 + WIDER) * (xa + xb) / h
        g[5] = -sin * (1.0 + WIDER) * (ya + yb) / h
    elif kind == GAP_DOWN:
        g[0] = -1.0
        g[3] = -cos
        g[4] = sin * (1.0 - WIDER) * xa
        g[5] = sin * (1.0 - WIDER) * ya
    elif kind == DN_UP:
        g[3] = cos
        g[4] = -sin * (1.0 + WIDER) * (xa + xb) / h
        g[5] = -sin * (1.0 + WIDER) * (ya + yb) / h
    elif kind == TANGENT:
        g[0] = mu[i] * (1.0 + WIDER)
        g[1] = -xa
        g[2] = -ya
    elif kind == CHORD:
        g[0] = -mu[i] * (0.5 * h - WIDER)
        g[1] = 0.5 * (xa + xb)
        g[2] = 0.5 * (ya + yb)
    elif kind == C_LEFT:
        g[0] = mu[i] * WIDER
        g[1] = -ya
        g[2] = xa
    elif kind == C_RIGHT:
        g[0] = mu[i] * WIDER
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
