"""A node's program, compiled: a dense dual simplex that starts from the parent's working set.

min cost . z subject to rows a . z >= b. The state is a working set of n independent rows: their ids, the
matrix W of their coefficients, its inverse T, right-hand sides, how many exchanges ago T was made (its age), the
point z = T rhs, its base values c and d, and multipliers y = T^T cost >= 0. While a row is
violated, the worst one enters and the ratio test picks the one that leaves. If none can leave, the entering row
and the working set add up to 0 >= positive: the program is infeasible and the multipliers are a Farkas ray.

Nothing is believed on the inverse's word: a ray counts only if it proves infeasibility for every z in the
box with the coefficients themselves, small parts of the wrong sign and the rows of the box dropped. Otherwise W is
factorised afresh; if that does not help, the rows of that contact or actuator are left out, which only loosens the
program.

Tolerances are absolute, forces and motions being scaled by the force scale: `FEASIBLE` for rows, the caller's for
friction outside its cone (tangents are made where it leaves), `PIVOT` for pivots (`SMALL` where there is no other,
which nearly parallel rows need, `FIRM` where such rows have made W singular). T is made afresh after `REFRESH`
exchanges; a singular W is reported, and the caller starts again from the box.
"""

from __future__ import annotations

import numpy as np

from handfast.stability.search.kernel.compiled import larger, quick, smaller
from handfast.stability.search.kernel.price import FEASIBLE, price, trigonometry
from handfast.stability.search.kernel.values import blend, row, values
from handfast.stability.search.rows import BOX_DOWN, BOX_UP, ENERGY, INDEX, KIND, PLAIN_DOWN, S_UP, T_UP

OPTIMAL, INFEASIBLE, FAILED = 0, 1, 2
ATTEMPTS = 3  # at a node: from a working set that was left, from the box, and there with firm pivots only
PIVOT, FIRM = 1e-7, 1e-5
SMALL = 1e-10
BLUR, CAUTIOUS = 1e-9, 1e-6  # multipliers may turn negative by this for a better pivot; rays do not care
ROUNDING = 1e-12  # of the terms of a ray: more than its checker allows for
PURE = 1e-10  # relative: a ray with more than this of the box is none
WIDE = 1e3  # the box, where a program seems empty for its sake
MISSING = 0.1  # (scaled) energy by which the balance must be missed for its row to enter
REFRESH = 40
EXCHANGES = 500


@quick
def invert(W, T, order, pivot):  # type: ignore[no-untyped-def]
    """The inverse T (n, N) of a working set W (n, n) by Gauss-Jordan; False if W is singular to working precision.

    Columns of T beyond n are zero: whole vectors are quicker. order (n,) and pivot (N,) are room.
    """
    n = W.shape[0]
    N = T.shape[1]
    for i in range(n):
        for j in range(n):
            T[i, j] = W[i, j]
        for j in range(n, N):
            T[i, j] = 0.0
    for k in range(n):
        best = k
        size = abs(T[k, k])
        for i in range(k + 1, n):
            if abs(T[i, k]) > size:
                best = i
                size = abs(T[i, k])
        if size < 1e-11:
            return False
        order[k] = best
        scale = 1.0 / T[best, k]
        T[best, k] = 1.0
        for j in range(N):
            x = T[best, j]
            T[best, j] = T[k, j]
            pivot[j] = x * scale
            T[k, j] = pivot[j]
        for i in range(n):
            f = T[i, k]
            if i != k and f != 0.0:
                T[i, k] = 0.0
                for j in range(N):
                    T[i, j] -= f * pivot[j]
    for k in range(n - 1, -1, -1):
        best = order[k]
        if best != k:
            for i in range(n):
                x = T[i, k]
                T[i, k] = T[i, best]
                T[i, best] = x
    return True


@quick
def solve(  # type: ignore[no-untyped-def]
    m, a, F, cos, sin, C, D, CT, DT, off, mu, lo, hi, box, capped, cost, driven, state, trig, skip,
    ids, W, rhs, T, order, y, z, c, d, enter_row, column, pivot, gradient, delta, stats, age,
    cone, attempt, data, balance, normal,
):  # fmt: skip
    """Solve a node's program from a working set; all of the state is changed in place.

    `ids`, `W`, `rhs`, `T`, `age` must be given and consistent; ids has one place more, for the entering row of a ray.
    attempt: in the first, poor pivots are taken where there is no other, and no row is left out; in the last, pivots
    are `FIRM`: the working set of others may turn out singular. capped: rays may cite the box. balance: the node of
    `data` at whose point the balance of energy is a row, -1 for none; normal (m,): the normal forces there. Returns
    OPTIMAL (z, y, c, d), INFEASIBLE (y: the ray's multipliers of `ids`, 1 for the last) or FAILED.
    """
    n = z.shape[0]
    N = T.shape[1]
    trigonometry(m, state, trig)
    for k in range(skip.shape[0]):
        skip[k] = False
    for k in range(n):  # the bound on the objective may have moved since, and the box may have been wider
        kind = ids[k] >> KIND
        if ids[k] == PLAIN_DOWN << KIND:
            rhs[k] = -hi[0] + off[3 * m + 2 * a]
        elif kind in (BOX_UP, BOX_DOWN):
            rhs[k] = -box[(ids[k] >> INDEX) & 255]
    since = age[0]
    fresh = True
    daring = attempt == 0
    usual = FIRM if attempt == 2 else PIVOT
    least = usual
    blur = BLUR if daring else CAUTIOUS
    wide = False
    for exchange in range(EXCHANGES):
        if since >= REFRESH:
            if not invert(W, T, order, pivot):
                return FAILED
            since = 0
            fresh = True
        if fresh:
            for k in range(n):
                y[k] = 0.0
            for j in range(n):
                total = 0.0
                x = cost[j]
                for k in range(n):
                    total += T[j, k] * rhs[k]
                    y[k] += x * T[j, k]
                z[j] = total
            values(CT, DT, off, z, c, d)
            largest = 0.0
            for j in range(n):
                largest = larger(largest, abs(z[j]))
            tol = FEASIBLE + 1e-14 * largest
            fresh = False
        enter = price(m, a, F, cos, sin, mu, lo, hi, driven, state, trig, c, d, tol, cone, skip)
        if enter < 0 and balance >= 0:
            last = D.shape[0] - 1
            missed = -d[last - 1] - data[balance, n] * d[last]
            for i in range(m):
                missed += normal[i] * (2.0 * c[3 * i] - normal[i])
            if missed >= MISSING:
                enter = (ENERGY << KIND) | balance
        if enter < 0:
            stats[1] += exchange
            age[0] = since
            return OPTIMAL
        b = row(enter, m, a, F, cos, sin, C, D, off, mu, lo, hi, box, data, enter_row, gradient)
        missed = b
        for j in range(n):
            missed -= enter_row[j] * z[j]
        for k in range(N):
            delta[k] = 0.0
        for j in range(n):
            x = enter_row[j]
            if x != 0.0:
                for k in range(N):
                    delta[k] += x * T[j, k]
        bound = np.inf
        for k in range(n):
            if delta[k] > least:
                bound = smaller(bound, (larger(y[k], 0.0) + blur) / delta[k])
        leave = -1
        size = 0.0
        for k in range(n):
            if delta[k] > least and larger(y[k], 0.0) <= bound * delta[k] and delta[k] > size:
                leave = k
                size = delta[k]
        if leave < 0:
            gap = b
            slip = ROUNDING * abs(b)
            cited = 1.0
            boxed = 0.0
            for j in range(n):
                z_total = enter_row[j]
                pivot[j] = z_total
                pivot[n + j] = abs(z_total)
            for k in range(n):
                f = delta[k]
                kind = ids[k] >> KIND
                if kind in (BOX_UP, BOX_DOWN) and not capped:  # nothing bounds the unknowns in truth
                    boxed = larger(boxed, -f)
                elif f < 0.0:
                    cited = larger(cited, -f)
                    gap -= f * rhs[k]
                    slip += ROUNDING * abs(f * rhs[k])
                    for j in range(n):
                        pivot[j] -= f * W[k, j]
                        pivot[n + j] += abs(f * W[k, j])
            for j in range(n):
                slip += (2.0 * abs(pivot[j]) + ROUNDING * pivot[n + j]) * box[j]
            if gap > slip and boxed > PURE * cited and not wide:
                for k in range(n):  # empty within the box, it may be: how about a larger one?
                    kind = ids[k] >> KIND
                    if kind in (BOX_UP, BOX_DOWN):
                        rhs[k] *= WIDE
                wide = True
                fresh = True
                continue
            if gap > slip and boxed <= PURE * cited:
                for k in range(n):
                    y[k] = larger(-delta[k], 0.0)
                ids[n] = enter
                y[n] = 1.0
                stats[1] += exchange
                return INFEASIBLE
        if leave < 0 or missed <= 0.0:  # the ray is too weak, or z has drifted from the working set
            if since > 0:
                since = REFRESH  # once more with a fresh inverse
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
        scale = 1.0 / delta[leave]
        theta = larger(y[leave], 0.0) * scale
        step = missed * scale
        for k in range(n):
            y[k] -= theta * delta[k]
            W[leave, k] = enter_row[k]
        y[leave] = theta
        for j in range(n):
            f = T[j, leave]
            column[j] = f * step
            z[j] += column[j]
            if f != 0.0:
                f *= scale
                for k in range(N):
                    T[j, k] -= f * delta[k]
                T[j, leave] = f
        blend(column, 0, DT, d)
        blend(column, DT.shape[0], CT, c)
        rhs[leave] = b
        ids[leave] = enter
        since += 1
        if least == SMALL:
            least = usual
            since = REFRESH
    return FAILED
