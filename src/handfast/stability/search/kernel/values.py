"""Rows from their names and base values from points, compiled; see `rows`."""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import quick
from handfast.proofs.kinds import (
    BOUND_UP,
    C_LEFT,
    C_RIGHT,
    C_SIDE,
    CHORD,
    CN_DOWN,
    CN_UP,
    CONE_WIDENING,
    D_LEFT,
    D_RIGHT,
    D_SIDE,
    DN_UP,
    E_DOWN,
    E_UP,
    ENERGY,
    GAP_DOWN,
    GAP_UP,
    S_DOWN,
    S_UP,
    SOFT_CHORD,
    SOFT_TANGENT,
    STILL_1_UP,
    T_DOWN,
    T_UP,
    TANGENT,
    TURN_DIRECTIONS,
    TURN_DOWN,
    TURN_UP,
)
from handfast.stability.search.kernel.patch import MIDDLE, REACH, patch
from handfast.stability.search.rows import ANGLE, BOX_DOWN, BOX_UP, INDEX, KIND_SHIFT, NODE, SIDE_SHIFT


@quick
def row(id, question, hi, data, out, gradient):
    """Coefficients of a named row into `out` (n,), over its base values into `gradient` (8,).

    hi: upper bounds of the plain base values; data: `Pool.data`. Returns b of out . z >= b.
    """
    kind = id >> KIND_SHIFT
    i = (id >> INDEX) & 255
    m = question.m
    n = out.shape[0]
    for j in range(n):
        out[j] = 0.0
    if kind == ENERGY:
        return energy_row(id & NODE, question, data, out)
    if kind in (BOX_UP, BOX_DOWN):
        out[i] = 1.0 if kind == BOX_UP else -1.0
        return -question.box[i]
    for k in range(8):
        gradient[k] = 0.0
    rhs = 0.0
    soft = ENERGY < kind < S_DOWN
    if kind == S_DOWN or T_UP <= kind <= S_UP:
        actuator_row(kind, gradient)
        force = 3 * m + 2 * i
        motion = 3 * m + i
    elif kind < T_UP or soft:
        if soft:
            soft_row(id, kind, question, gradient)
        else:
            contact_row(id, kind, question, gradient)
        force = 3 * i  # the first of the values that it combines
        motion = 3 * i
    else:
        force = 3 * m + 2 * question.a + i
        motion = 3 * m + question.a + force - question.F
        gradient[0 if force < question.F else 3] = 1.0 if kind == BOUND_UP else -1.0
        rhs = question.lo[i] if kind == BOUND_UP else -hi[i]
    for k in range(3):
        x = gradient[k]
        if x != 0.0:
            rhs -= x * question.off[force + k]
            for j in range(n):
                out[j] += x * question.C[force + k, j]
        x = gradient[3 + k]
        if x != 0.0:
            rhs -= x * question.before[motion + k]
            for j in range(n):
                out[j] += x * question.D[motion + k, j]
    if soft:
        force = question.twist + question.soft[i]
        motion = question.turning + question.soft[i]
        rhs -= gradient[6] * question.off[force]
        for j in range(n):
            out[j] += gradient[6] * question.C[force, j] + gradient[7] * question.D[motion, j]
    return rhs


@quick
def energy_row(node, question, data, out):
    """The tangent of the balance of energy at the point of a node into `out` (n,); returns b."""
    C = question.C
    D = question.D
    off = question.off
    n = out.shape[0]
    last = D.shape[0] - 1
    rhs = 0.0
    for j in range(n):
        out[j] = D[last - 1, j] + data[node, n] * D[last, j]
    for k in range(0, 3 * question.m, 3):
        cn = off[k]
        for j in range(n):
            cn += C[k, j] * data[node, j]
        rhs += cn * (2.0 * off[k] - cn)
        for j in range(n):
            out[j] -= (2.0 * cn + question.before[k]) * C[k, j]
        rhs += question.before[k] * off[k]
    return rhs


@quick
def contact_row(id, kind, question, g):
    """A contact's row over its forces and motions into g (6,)."""
    mu = question.mu[(id >> INDEX) & 255]
    cos = question.cos
    sin = question.sin
    xa = ya = xb = yb = 0.0
    h = 1.0
    if sin > 0.0 or (kind >= TANGENT and kind < STILL_1_UP):
        turn = 2 * np.pi / TURN_DIRECTIONS
        left = ((id >> ANGLE) & (2 * TURN_DIRECTIONS - 1)) * turn
        right = (id & (2 * TURN_DIRECTIONS - 1)) * turn
        xa = np.cos(left)
        ya = np.sin(left)
        xb = np.cos(right)
        yb = np.sin(right)
        h = 1.0 + xa * xb + ya * yb
    if kind == CN_UP:
        g[0] = 1.0
    elif kind == CN_DOWN:
        g[0] = -1.0
    elif kind in (GAP_UP, DN_UP):
        g[0] = 1.0 if kind == GAP_UP else 0.0
        g[3] = cos
        g[4] = -sin * (1.0 + CONE_WIDENING) * (xa + xb) / h
        g[5] = -sin * (1.0 + CONE_WIDENING) * (ya + yb) / h
    elif kind == GAP_DOWN:
        g[0] = -1.0
        g[3] = -cos
        g[4] = sin * (1.0 - CONE_WIDENING) * xa
        g[5] = sin * (1.0 - CONE_WIDENING) * ya
    elif kind == TANGENT:
        g[0] = mu * (1.0 + CONE_WIDENING)
        g[1] = -xa
        g[2] = -ya
    elif kind == CHORD:
        g[0] = -mu * (0.5 * h - CONE_WIDENING)
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
    else:
        g[4 if kind < STILL_1_UP + 2 else 5] = 1.0 if (kind - STILL_1_UP) % 2 == 0 else -1.0


@quick
def soft_row(id, kind, question, g):
    """A soft finger's row over its forces, motions, torsion and turning into g (8,), which has room for a patch."""
    mu = question.mu[(id >> INDEX) & 255]
    if kind == SOFT_TANGENT:
        turn = 2 * np.pi / TURN_DIRECTIONS
        around = ((id >> ANGLE) & (2 * TURN_DIRECTIONS - 1)) * turn
        up = (id & (2 * TURN_DIRECTIONS - 1)) * turn
        g[0] = mu * (1.0 + CONE_WIDENING)
        g[1] = -np.cos(up) * np.cos(around)
        g[2] = -np.cos(up) * np.sin(around)
        g[6] = -np.sin(up)
    elif kind in (TURN_UP, TURN_DOWN):
        g[7] = 1.0 if kind == TURN_UP else -1.0
    else:
        patch(id & ((1 << SIDE_SHIFT) - 1), g, 8)
        k = 8 + 3 * ((id >> SIDE_SHIFT) & 3)
        if kind == SOFT_CHORD:
            k = 8 + MIDDLE
            g[0] = -mu * (g[8 + REACH] - CONE_WIDENING)
        elif kind == C_SIDE:
            g[0] = mu * CONE_WIDENING
        if kind == D_SIDE:
            g[4] = -g[k]
            g[5] = -g[k + 1]
            g[7] = -g[k + 2]
        else:
            g[1] = g[k]
            g[2] = g[k + 1]
            g[6] = g[k + 2]


@quick
def actuator_row(kind, g):
    """An actuator's row over its force above the command, its effort left and its motion into g (6,)."""
    if kind <= T_DOWN:
        g[3] = 1.0 if kind == T_UP else -1.0
    elif kind <= E_DOWN:
        g[0] = 1.0 if kind == E_UP else -1.0
    else:
        g[1] = 1.0 if kind == S_UP else -1.0


@quick
def blend(x, first, rows, out):
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
def values(question, z, c, d):
    """The base values of a point z, forces into c, motions into d."""
    for k in range(c.shape[0]):
        c[k] = question.off[k]
    for k in range(d.shape[0]):
        d[k] = question.before[k]
    blend(z, 0, question.DT, d)
    blend(z, question.DT.shape[0], question.CT, c)
