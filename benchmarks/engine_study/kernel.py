"""The linear program of a tree node, compiled: a dense dual simplex that starts from the parent's basis.

min cost . z subject to rows a_k . z >= b_k, z in R^n. The state is a working set of n independent rows
(a basis B, its inverse, z = B^-1 b, multipliers y = B^-T cost >= 0). While a row is violated it enters and
the ratio test picks the row that leaves; if none can, the row and the working set add up to 0 >= positive:
the program is infeasible, and the multipliers are a Farkas ray.

Rows are named, not stored: a kind, a contact or actuator, and up to two angles make a row on the fly from
the base rows (the model's unknowns as functions of z). A working set is a list of names, so a parent's is
legal in every child, whose rows imply the parent's. Cone rows are tangents, made where they are violated.

Layout of the base rows: contact i has c_n, c_t1, c_t2, d_n, d_t1, d_t2 in rows 6i .. 6i+5; actuator j has
t, f - f_c in rows 6m + 2j, 6m + 2j + 1; then lambda; then the bounded motions. Value of a base row:
base[k] . z + offset[k].
"""

from __future__ import annotations

import numpy as np
from numba import njit

# kinds of rows; "i" is a contact, "j" an actuator, "k" a bounded motion, "a", "b" angles
CN_UP, CN_DOWN, DN_UP, GAP_UP, GAP_DOWN, TANGENT, CHORD = 0, 1, 2, 3, 4, 5, 6
C_LEFT, C_RIGHT, D_LEFT, D_RIGHT, DT1_UP, DT1_DOWN, DT2_UP, DT2_DOWN = 7, 8, 9, 10, 11, 12, 13, 14
T_UP, T_DOWN, E_UP, E_DOWN, LAMBDA_UP, LAMBDA_DOWN, MOTION_UP, MOTION_DOWN, BOX_UP, BOX_DOWN = range(15, 25)

# what a contact is in a node
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = 0, 1, 2, 3, 4
# what an actuator is in a node
FREE, LOCKED, MOVES = 0, 1, 2

OPTIMAL, INFEASIBLE, FAILED = 0, 1, 2
FEASIBLE = 1e-9  # a row may be missed by this, relative to the terms it adds up
PIVOT = 1e-7
CONE = 1e-8  # friction may leave the cone by this before a tangent is made
PIVOTS = 3000
MOTION_KIND = MOTION_UP


@njit(cache=True)
def make_row(kind, i, a, b, base, offset, mu, m, acts, lam, lambda_low, lambda_high, cap, box, out):  # type: ignore[no-untyped-def]
    """Coefficients of one named row into `out`; returns its right-hand side: out . z >= returned."""
    n = out.shape[0]
    for j in range(n):
        out[j] = 0.0
    rhs = 0.0
    k = 6 * i
    if kind in (CN_UP, CN_DOWN):
        s = 1.0 if kind == CN_UP else -1.0
        for j in range(n):
            out[j] = s * base[k, j]
        rhs = -s * offset[k]
    elif kind == DN_UP:
        for j in range(n):
            out[j] = base[k + 3, j]
        rhs = -offset[k + 3]
    elif kind in (GAP_UP, GAP_DOWN):
        s = 1.0 if kind == GAP_UP else -1.0
        for j in range(n):
            out[j] = s * (base[k, j] + base[k + 3, j])
        rhs = -s * (offset[k] + offset[k + 3])
    elif kind == TANGENT:
        x, y = np.cos(a), np.sin(a)
        for j in range(n):
            out[j] = mu[i] * base[k, j] - x * base[k + 1, j] - y * base[k + 2, j]
        rhs = -(mu[i] * offset[k] - x * offset[k + 1] - y * offset[k + 2])
    elif kind == CHORD:
        x, y, h = np.cos((a + b) / 2), np.sin((a + b) / 2), np.cos((b - a) / 2) * mu[i]
        for j in range(n):
            out[j] = x * base[k + 1, j] + y * base[k + 2, j] - h * base[k, j]
        rhs = -(x * offset[k + 1] + y * offset[k + 2] - h * offset[k])
    elif kind in (C_LEFT, C_RIGHT):  # u_a x c_t >= 0, c_t x u_b >= 0
        s = 1.0 if kind == C_LEFT else -1.0
        x, y = s * np.cos(a), s * np.sin(a)
        for j in range(n):
            out[j] = x * base[k + 2, j] - y * base[k + 1, j]
        rhs = -(x * offset[k + 2] - y * offset[k + 1])
    elif kind in (D_LEFT, D_RIGHT):  # the same for -d_t
        s = -1.0 if kind == D_LEFT else 1.0
        x, y = s * np.cos(a), s * np.sin(a)
        for j in range(n):
            out[j] = x * base[k + 5, j] - y * base[k + 4, j]
        rhs = -(x * offset[k + 5] - y * offset[k + 4])
    elif kind >= DT1_UP and kind <= DT2_DOWN:
        s = 1.0 if (kind - DT1_UP) % 2 == 0 else -1.0
        r = k + 4 + (kind - DT1_UP) // 2
        for j in range(n):
            out[j] = s * base[r, j]
        rhs = -s * offset[r]
    elif kind >= T_UP and kind <= E_DOWN:
        s = 1.0 if (kind - T_UP) % 2 == 0 else -1.0
        r = 6 * m + 2 * i + (kind - T_UP) // 2
        for j in range(n):
            out[j] = s * base[r, j]
        rhs = -s * offset[r]
    elif kind in (LAMBDA_UP, LAMBDA_DOWN):
        s = 1.0 if kind == LAMBDA_UP else -1.0
        for j in range(n):
            out[j] = s * base[lam, j]
        rhs = s * (lambda_low if kind == LAMBDA_UP else lambda_high) - s * offset[lam]
    elif kind in (MOTION_UP, MOTION_DOWN):
        s = 1.0 if kind == MOTION_UP else -1.0
        r = lam + 1 + i
        for j in range(n):
            out[j] = s * base[r, j]
        rhs = -cap - s * offset[r]
    else:
        s = 1.0 if kind == BOX_UP else -1.0
        out[i] = s
        rhs = -box
    norm = 0.0
    for j in range(n):
        norm += out[j] * out[j]
    norm = np.sqrt(norm)
    if norm < 1e-13:  # a row without unknowns: satisfied, or not, by itself
        return rhs if rhs <= 1e-9 else 1.0
    for j in range(n):
        out[j] /= norm
    return rhs / norm


@njit(cache=True)
def node_rows(touch, left, right, motor, moving, motions, kinds, index, first, second):  # type: ignore[no-untyped-def]
    """Names of the rows that a node's states ask for; returns how many."""
    n = 0
    for i in range(len(touch)):
        state = touch[i]
        kinds[n], index[n] = CN_UP, i
        n += 1
        for q in range(4):
            kinds[n], index[n], first[n] = TANGENT, i, q * np.pi / 2
            n += 1
        if state == OPEN:
            kinds[n], index[n] = CN_DOWN, i
            kinds[n + 1], index[n + 1] = DN_UP, i
            n += 2
            continue
        kinds[n], index[n] = GAP_UP, i
        n += 1
        if state != UNDECIDED:
            kinds[n], index[n] = GAP_DOWN, i
            n += 1
        if state == STICK:
            for kind in range(DT1_UP, DT2_DOWN + 1):
                kinds[n], index[n] = kind, i
                n += 1
        if state == SLIDE:
            a, b = left[i], right[i]
            kinds[n], index[n], first[n], second[n] = CHORD, i, a, b
            kinds[n + 1], index[n + 1], first[n + 1] = C_LEFT, i, a
            kinds[n + 2], index[n + 2], first[n + 2] = C_RIGHT, i, b
            kinds[n + 3], index[n + 3], first[n + 3] = D_LEFT, i, a
            kinds[n + 4], index[n + 4], first[n + 4] = D_RIGHT, i, b
            kinds[n + 5], index[n + 5], first[n + 5] = TANGENT, i, a
            kinds[n + 6], index[n + 6], first[n + 6] = TANGENT, i, b
            n += 7
    for j in range(len(motor)):
        if not moving[j]:
            continue
        kinds[n], index[n] = T_UP, j
        kinds[n + 1], index[n + 1] = E_UP, j
        n += 2
        if motor[j] == LOCKED:
            kinds[n], index[n] = T_DOWN, j
            n += 1
        if motor[j] == MOVES:
            kinds[n], index[n] = E_DOWN, j
            n += 1
    kinds[n], kinds[n + 1] = LAMBDA_UP, LAMBDA_DOWN
    index[n], index[n + 1] = 0, 0
    n += 2
    for k in range(motions):
        kinds[n], index[n] = MOTION_UP, k
        kinds[n + 1], index[n + 1] = MOTION_DOWN, k
        n += 2
    return n


@njit(cache=True)
def solve_node(  # type: ignore[no-untyped-def]
    base,
    offset,
    mu,
    m,
    acts,
    lam,
    motions,
    moving,
    lambda_low,
    lambda_high,
    cap,
    box,
    cost,
    touch,
    left,
    right,
    motor,
    w_kind,
    w_index,
    w_first,
    w_second,
    z,
):
    """Solve a node's program from the parent's working set (changed in place); z (n,) is written.

    Returns (status, pivots).
    """
    n = z.shape[0]
    room = 16 * m + 4 * acts + 2 * motions + 2 + 2 * n + 400
    kinds, index = np.zeros(room, np.int64), np.zeros(room, np.int64)
    first, second = np.zeros(room), np.zeros(room)
    rows = node_rows(touch, left, right, motor, moving, motions, kinds[n:], index[n:], first[n:], second[n:]) + n
    for k in range(n):
        kinds[k], index[k], first[k], second[k] = w_kind[k], w_index[k], w_first[k], w_second[k]
    A, rhs = np.zeros((room, n)), np.zeros(room)
    for k in range(rows):
        rhs[k] = make_row(
            kinds[k],
            index[k],
            first[k],
            second[k],
            base,
            offset,
            mu,
            m,
            acts,
            lam,
            lambda_low,
            lambda_high,
            cap,
            box,
            A[k],
        )
    W = np.arange(n)
    inside = np.zeros(room, np.bool_)
    inside[:n] = True
    inverse = np.linalg.inv(A[:n].copy())
    y = np.zeros(n)
    direction, column = np.zeros(n), np.zeros(n)
    since = 0
    for pivots in range(PIVOTS):
        if since >= 60:
            B = np.zeros((n, n))
            for k in range(n):
                for j in range(n):
                    B[k, j] = A[W[k], j]
            inverse = np.linalg.inv(B)
            since = 0
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += inverse[j, k] * rhs[W[k]]
            z[j] = total
        for k in range(n):
            total = 0.0
            for j in range(n):
                total += cost[j] * inverse[j, k]
            y[k] = max(total, 0.0)
        worst, enter = 0.0, -1
        for k in range(rows):
            if inside[k]:
                continue
            total, size = -rhs[k], abs(rhs[k])
            for j in range(n):
                term = A[k, j] * z[j]
                total += term
                size = max(size, abs(term))
            missed = -total - FEASIBLE * max(1.0, 1e-3 * size)
            if missed > worst:
                worst, enter = missed, k
        if enter < 0:
            made = False
            if rows + m < room:
                for i in range(m):
                    k = 6 * i
                    cn, x, v = offset[k], offset[k + 1], offset[k + 2]
                    for j in range(n):
                        cn += base[k, j] * z[j]
                        x += base[k + 1, j] * z[j]
                        v += base[k + 2, j] * z[j]
                    if np.hypot(x, v) > mu[i] * cn + CONE * max(1.0, cn):
                        kinds[rows], index[rows], first[rows], second[rows] = TANGENT, i, np.arctan2(v, x), 0.0
                        rhs[rows] = make_row(
                            TANGENT,
                            i,
                            first[rows],
                            0.0,
                            base,
                            offset,
                            mu,
                            m,
                            acts,
                            lam,
                            lambda_low,
                            lambda_high,
                            cap,
                            box,
                            A[rows],
                        )
                        rows += 1
                        made = True
            if made:
                continue
            for k in range(n):
                w_kind[k], w_index[k] = kinds[W[k]], index[W[k]]
                w_first[k], w_second[k] = first[W[k]], second[W[k]]
            return OPTIMAL, pivots
        for k in range(n):
            total = 0.0
            for j in range(n):
                total += A[enter, j] * inverse[j, k]
            direction[k] = total
        leave, ratio, size = -1, np.inf, 0.0
        for k in range(n):
            if direction[k] > PIVOT:
                t = y[k] / direction[k]
                if t < ratio - 1e-12 or (t <= ratio + 1e-12 and direction[k] > size):
                    leave, ratio, size = k, min(t, ratio), direction[k]
        if leave < 0:
            # believe it only if the ray, with its small positive parts dropped, still proves it for every z in the box
            gap, slip = rhs[enter], 0.0
            for k in range(n):
                gap -= min(direction[k], 0.0) * rhs[W[k]]
            for j in range(n):
                total = A[enter, j]
                for k in range(n):
                    total -= min(direction[k], 0.0) * A[W[k], j]
                slip += abs(total)
            if gap > slip * box:
                return INFEASIBLE, pivots
            inside[enter] = True  # missed by rounding: leave it out, which only loosens the program
            continue
        for j in range(n):
            column[j] = inverse[j, leave] / direction[leave]
        for k in range(n):
            if k == leave:
                continue
            if direction[k] != 0.0:
                for j in range(n):
                    inverse[j, k] -= direction[k] * column[j]
        for j in range(n):
            inverse[j, leave] = column[j]
        inside[W[leave]] = False
        W[leave] = enter
        inside[enter] = True
        since += 1
    return FAILED, PIVOTS
