"""A node's program, compiled: a dense dual simplex that starts from the parent's working set.

min cost . z subject to rows a . z >= b. The state is a working set of n independent rows: their ids, the
matrix W of their coefficients, right-hand sides, the edges (columns of the inverse, and how base values change
along them), the point z = W^-1 rhs, its base values v and multipliers y = W^-T cost >= 0. While a row is
violated, the worst one enters and the ratio test picks the one that leaves. If none can leave, the entering row
and the working set add up to 0 >= positive: the program is infeasible and the multipliers are a Farkas ray.

Nothing is believed on the inverse's word: a ray counts only if it proves infeasibility for every z in the
box with the coefficients themselves, small parts of the wrong sign dropped. Otherwise W is factorised
afresh; if that does not help, the rows of that contact or actuator are left out, which only loosens the program.

Tolerances are absolute, forces and motions being scaled by the force scale: `FEASIBLE` for rows, the caller's for
friction outside its cone (tangents are made where it leaves), `PIVOT` for pivots (`SMALL` where there is no
other, which nearly parallel rows need). W is refactorised after
`REFRESH` exchanges; a singular W is reported, and the caller starts again from the box.
"""

from __future__ import annotations

import numpy as np

from holdfast.stability.engine.price import FEASIBLE, price, trigonometry
from holdfast.stability.engine.rows import (
    BOX_UP,
    ENERGY,
    INDEX,
    KIND,
    PLAIN_DOWN,
    S_UP,
    T_UP,
    inner,
    place,
    row,
    values,
)

OPTIMAL, INFEASIBLE, FAILED = 0, 1, 2
PIVOT = 1e-7
SMALL = 1e-10
BLUR, CAUTIOUS = 1e-9, 1e-6  # multipliers may turn negative by this for a better pivot; rays do not care
ROUNDING = 1e-12  # of the terms of a ray: more than its checker allows for
MISSING = 0.1  # (scaled) energy by which the balance must be missed for its row to enter
REFRESH = 40
EXCHANGES = 500


@inner
def invert(W, BT, edges, pivot):  # type: ignore[no-untyped-def]
    """The edges of a working set W (n, n) by Gauss-Jordan; False if W is singular to working precision.

    Row k of edges (n, n + nb) is how the point and its base values move per unit of the right-hand side k:
    column k of the inverse, and B times it. pivot (n + nb,) is room.
    """
    n = W.shape[0]
    order = np.empty(n, np.int64)
    for i in range(n):
        for j in range(n):
            edges[i, j] = W[j, i]
    for k in range(n):
        best = k
        size = abs(edges[k, k])
        for i in range(k + 1, n):
            if abs(edges[i, k]) > size:
                best = i
                size = abs(edges[i, k])
        if size < 1e-11:
            return False
        order[k] = best
        scale = 1.0 / edges[best, k]
        edges[best, k] = 1.0
        for j in range(n):
            x = edges[best, j]
            edges[best, j] = edges[k, j]
            pivot[j] = x * scale
            edges[k, j] = pivot[j]
        for i in range(n):
            f = edges[i, k]
            if i != k and f != 0.0:
                edges[i, k] = 0.0
                for j in range(n):
                    edges[i, j] -= f * pivot[j]
    for k in range(n - 1, -1, -1):
        best = order[k]
        if best != k:
            for i in range(n):
                x = edges[i, k]
                edges[i, k] = edges[i, best]
                edges[i, best] = x
    for k in range(n):
        edges[k, n:] = 0.0
        for j in range(n):
            x = edges[k, j]
            if x != 0.0:
                for b in range(BT.shape[1]):
                    edges[k, n + b] += x * BT[j, b]
    return True


@inner
def solve(  # type: ignore[no-untyped-def]
    m, a, cos, sin, B, BT, off, mu, lo, hi, box, cost, driven, state, trig, skip,
    ids, W, rhs, edges, y, z, v, enter_row, pivot, gradient, delta, stats, cone, daring, data, balance,
):  # fmt: skip
    """Solve a node's program from a working set; all of the state is changed in place.

    `ids`, `W`, `rhs`, `edges` must be given and consistent; ids has one place more, for the entering row of a
    ray. daring: poor pivots are taken where there is no other, and no
    row is left out. balance: the node of `data` at whose point the balance of energy is a row, -1 for none.
    Returns OPTIMAL (z, y, v), INFEASIBLE (y: the
    ray's multipliers of `ids`, 1 for the last) or FAILED.
    """
    n = z.shape[0]
    nb = off.shape[0]
    trigonometry(m, state, trig)
    for k in range(skip.shape[0]):
        skip[k] = False
    for k in range(n):  # the bound on the objective may have moved since
        if ids[k] == PLAIN_DOWN << KIND:
            rhs[k] = -hi[0] + off[off.shape[0] - lo.shape[0]]
    since = 0
    fresh = True
    least = PIVOT
    blur = BLUR if daring else CAUTIOUS
    for exchange in range(EXCHANGES):
        if since >= REFRESH:
            if not invert(W, BT, edges, pivot):
                return FAILED
            since = 0
            fresh = True
        if fresh:
            for j in range(n):
                z[j] = 0.0
            for k in range(n):
                x = rhs[k]
                total = 0.0
                for j in range(n):
                    z[j] += x * edges[k, j]
                    total += cost[j] * edges[k, j]
                y[k] = total
            values(BT, off, z, v)
            largest = 0.0
            for j in range(n):
                largest = max(largest, abs(z[j]))
            tol = FEASIBLE + 1e-14 * largest
            fresh = False
        enter = price(m, a, cos, sin, mu, lo, hi, driven, state, trig, v, tol, cone, skip)
        if enter < 0 and balance >= 0:
            enter = (ENERGY << KIND) | balance
            missed = row(enter, m, cos, sin, B, off, mu, lo, hi, box, data, enter_row, gradient)
            for j in range(n):
                missed -= enter_row[j] * z[j]
            if missed < MISSING:
                enter = -1
        if enter < 0:
            stats[1] += exchange
            return OPTIMAL
        b = row(enter, m, cos, sin, B, off, mu, lo, hi, box, data, enter_row, gradient)
        first, count = place(enter, m, nb, lo.shape[0])
        missed = b
        for j in range(n):
            missed -= enter_row[j] * z[j]
        for k in range(n):
            total = 0.0
            if enter >> KIND == ENERGY:
                for j in range(n):
                    total += enter_row[j] * edges[k, j]
            else:
                for j in range(count):
                    total += gradient[j] * edges[k, n + first + j]
            delta[k] = total
        bound = np.inf
        for k in range(n):
            if delta[k] > least:
                bound = min(bound, (max(y[k], 0.0) + blur) / delta[k])
        leave = -1
        size = 0.0
        for k in range(n):
            if delta[k] > least and max(y[k], 0.0) <= bound * delta[k] and delta[k] > size:
                leave = k
                size = delta[k]
        if leave < 0:
            gap = b
            slip = ROUNDING * abs(b)
            for j in range(n):
                z_total = enter_row[j]
                pivot[j] = z_total
                pivot[n + j] = abs(z_total)
            for k in range(n):
                f = delta[k]
                if f < 0.0:
                    gap -= f * rhs[k]
                    slip += ROUNDING * abs(f * rhs[k])
                    for j in range(n):
                        pivot[j] -= f * W[k, j]
                        pivot[n + j] += abs(f * W[k, j])
            for j in range(n):
                slip += (2.0 * abs(pivot[j]) + ROUNDING * pivot[n + j]) * box[j]
            if gap > slip:
                for k in range(n):
                    y[k] = max(-delta[k], 0.0)
                ids[n] = enter
                y[n] = 1.0
                stats[1] += exchange
                return INFEASIBLE
        if leave < 0 or missed <= 0.0:  # the ray is too weak, or z has drifted from the working set
            if since > 0:
                since = REFRESH  # once more with fresh edges
                continue
            if leave < 0 and least == PIVOT and daring:
                least = SMALL  # nearly parallel rows: better a poor pivot than none
                continue
            if daring:
                return FAILED  # a poor working set: the caller starts again from the box
            if enter >> KIND == ENERGY:
                balance = -1
                stats[2] += 1
                continue
            part = (enter >> INDEX) & 255
            if enter >> KIND >= T_UP:
                part += m if enter >> KIND <= S_UP else m + a
            if skip[part] or enter >> KIND >= BOX_UP:
                return FAILED
            skip[part] = True
            stats[2] += 1
            continue
        step = missed / delta[leave]
        theta = max(y[leave], 0.0) / delta[leave]
        scale = 1.0 / delta[leave]
        for k in range(n):
            y[k] -= theta * delta[k]
            W[leave, k] = enter_row[k]
        y[leave] = theta
        for j in range(n):
            z[j] += step * edges[leave, j]
        for j in range(nb):
            v[j] += step * edges[leave, n + j]
        for j in range(n + nb):
            pivot[j] = edges[leave, j] * scale
        for k in range(n):
            f = delta[k]
            if f != 0.0:
                for j in range(n + nb):
                    edges[k, j] -= f * pivot[j]
        for j in range(n + nb):
            edges[leave, j] = pivot[j]
        rhs[leave] = b
        ids[leave] = enter
        since += 1
        if least == SMALL:
            least = PIVOT
            since = REFRESH
    return FAILED
