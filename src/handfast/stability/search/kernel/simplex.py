"""A node's program, compiled: a dense dual simplex that starts from the parent's working set.

min cost . z subject to rows a . z >= b. The state is a `WorkingSet` of n independent rows: their ids, the
matrix of their coefficients, its inverse, right-hand sides, how many exchanges ago the inverse was made (its age),
the point z = inverse rhs, its base values c and d, and multipliers y = inverse^T cost >= 0. While a row is
violated, the worst one enters and the ratio test picks the one that leaves. If none can leave, the entering row
and the working set add up to 0 >= positive: the program is infeasible and the multipliers are a Farkas ray.

Nothing is believed on the inverse's word: a ray counts only if it proves infeasibility for every z in the
box with the coefficients themselves, small parts of the wrong sign and the rows of the box dropped. Otherwise the
inverse is made afresh; if that does not help, the rows of that contact or actuator are left out, which only loosens the
program.

Tolerances are absolute, forces and motions being scaled by the force scale: `ROW_TOLERANCE` for rows, the caller's for
friction outside its cone (tangents are made where it leaves), `PIVOT` for pivots (`FALLBACK_PIVOT` where there is no
other, which nearly parallel rows need, `FIRM` where such rows have made the matrix singular). The inverse is made
afresh after `REFRESH` exchanges; a singular matrix is reported, and the caller starts again from the box.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import larger, quick, smaller
from handfast.proofs.kinds import BOUND_DOWN, ENERGY, OPEN, S_DOWN, S_UP, SLIDE, T_UP
from handfast.stability.search.arrays import DROPS, EXCHANGES
from handfast.stability.search.kernel.price import ROW_TOLERANCE, price, trigonometry
from handfast.stability.search.kernel.split import select
from handfast.stability.search.kernel.values import blend, row, values
from handfast.stability.search.rows import BOX_DOWN, BOX_UP, INDEX, KIND_SHIFT

OPTIMAL, INFEASIBLE, FAILED = 0, 1, 2
NO_RAY, RAY, RAY_OF_BOX = 0, 1, 2  # what an entering row that nothing can leave for shows
ATTEMPTS = 3  # at a node: from a working set that was left, from the box, and there with firm pivots only
PIVOT, FIRM = 1e-7, 1e-5
FALLBACK_PIVOT = 1e-10
BLUR, CAUTIOUS = 1e-9, 1e-6  # multipliers may turn negative by this for a better pivot; rays do not care
RAY_ROUNDING = 1e-12  # of the terms of a ray: more than its checker allows for
PURE = 1e-10  # relative: a ray with more than this of the box is none
BOX_WIDENING = 1e3  # the box, where a program seems empty for its sake
MISSING = 0.1  # (scaled) energy by which the balance must be missed for its row to enter
REFRESH = 80
MOST_EXCHANGES = 500
MUCH = 30.0


@quick
def invert(work):
    """The inverse of a working set by Gauss-Jordan; False if its matrix is singular to working precision.

    Columns of the inverse beyond n are zero: whole vectors are quicker.
    """
    inverse = work.inverse
    pivot = work.pivot
    n = work.matrix.shape[0]
    N = inverse.shape[1]
    for i in range(n):
        for j in range(n):
            inverse[i, j] = work.matrix[i, j]
        for j in range(n, N):
            inverse[i, j] = 0.0
    for k in range(n):
        best = k
        size = abs(inverse[k, k])
        for i in range(k + 1, n):
            if abs(inverse[i, k]) > size:
                best = i
                size = abs(inverse[i, k])
        if size < 1e-11:
            return False
        work.order[k] = best
        scale = 1.0 / inverse[best, k]
        inverse[best, k] = 1.0
        for j in range(N):
            x = inverse[best, j]
            inverse[best, j] = inverse[k, j]
            pivot[j] = x * scale
            inverse[k, j] = pivot[j]
        for i in range(n):
            f = inverse[i, k]
            if i != k and f != 0.0:
                inverse[i, k] = 0.0
                for j in range(N):
                    inverse[i, j] -= f * pivot[j]
    for k in range(n - 1, -1, -1):
        best = work.order[k]
        if best != k:
            for i in range(n):
                x = inverse[i, k]
                inverse[i, k] = inverse[i, best]
                inverse[i, best] = x
    return True


@quick
def solve(question, hi, node, work, counts, cone, loose, attempt, data, balance):
    """Solve a node's program from a working set; node.skip, node.trig and `work` are changed in place.

    ids (n of them), matrix, rhs, inverse and age of `work` must be given and consistent. hi: upper bounds of the plain
    base values. attempt: in the first, poor pivots are taken where there is no other, and no row is left out; in the
    last, pivots are `FIRM`: the working set of others may turn out singular. balance: the node of `data` at whose
    point, with normal forces node.normal, the balance of energy is a row, -1 for none. cone, loose: by how much
    friction may leave its cone: by `loose` where the model is missed by MUCH times that or more and what to decide next
    is no sector, which node.violation says then. A sector could be cut without end on what is loose.

    Returns OPTIMAL (z, y, c, d), INFEASIBLE (y: the ray's multipliers of ids, 1 for the last) or FAILED.
    """
    trigonometry(question, node)
    begin(question, hi, node, work)
    since = work.age[0]
    fresh = True
    daring = attempt == 0
    usual = FIRM if attempt == 2 else PIVOT
    least = usual
    wide = False
    tolerance = ROW_TOLERANCE
    node.violation[2] = loose
    for exchange in range(MOST_EXCHANGES):
        if since >= REFRESH:
            if not invert(work):
                return FAILED
            since = 0
            fresh = True
        if fresh:
            tolerance = place(question, work)
            fresh = False
        enter = price(question, hi, node, work.c, work.d, tolerance, node.violation[2])
        if enter < 0 and balance >= 0 and imbalance(question, node, work, data, balance) >= MISSING:
            enter = (ENERGY << KIND_SHIFT) | balance
        if enter < 0 and node.violation[2] > cone:
            pick = select(question, node, work.c, work.d, cone, node.violation[2])
            if node.violation[0] < MUCH * loose or (0 <= pick < question.m and node.state[pick] in (OPEN, SLIDE)):
                node.violation[2] = cone
                continue
        if enter < 0:
            counts[EXCHANGES] += exchange
            work.age[0] = since
            return OPTIMAL
        b = row(enter, question, hi, data, work.entering, work.gradient)
        missed = against(work, b)
        leave = leaving(work, least, BLUR if daring else CAUTIOUS)
        if leave < 0:
            shown = ray(question, work, b)
            if shown == RAY_OF_BOX and not wide:  # empty within the box, it may be: how about a larger one?
                widen(work)
                wide = True
                fresh = True
                continue
            if shown == RAY:
                for k in range(question.cost.shape[0]):
                    work.y[k] = larger(-work.delta[k], 0.0)
                work.ids[question.cost.shape[0]] = enter
                work.y[question.cost.shape[0]] = 1.0
                counts[EXCHANGES] += exchange
                return INFEASIBLE
        if leave < 0 or missed <= 0.0:  # the ray is too weak, or z has drifted from the working set
            if since > 0:
                since = REFRESH  # once more with a fresh inverse
                continue
            if leave < 0 and least == PIVOT and daring:
                least = FALLBACK_PIVOT  # nearly parallel rows: better a poor pivot than none
                continue
            if daring:
                return FAILED  # a poor working set: the caller starts again from the box
            if enter >> KIND_SHIFT == ENERGY:
                balance = -1
            elif not leave_out(enter, question, node):
                return FAILED
            counts[DROPS] += 1
            continue
        swap(question, work, enter, leave, b, missed)
        since += 1
        if least == FALLBACK_PIVOT:
            least = usual
            since = REFRESH
    return FAILED


@quick
def begin(question, hi, node, work):
    """No row is left out; right-hand sides are those of now.

    The cut may have moved since, and the box may have been wider.
    """
    for k in range(node.skip.shape[0]):
        node.skip[k] = False
    for k in range(question.cost.shape[0]):
        kind = work.ids[k] >> KIND_SHIFT
        if work.ids[k] == BOUND_DOWN << KIND_SHIFT:
            work.rhs[k] = -hi[0] + question.off[3 * question.m + 2 * question.a]
        elif kind in (BOX_UP, BOX_DOWN):
            work.rhs[k] = -question.box[(work.ids[k] >> INDEX) & 255]


@quick
def place(question, work):
    """Point, multipliers and base values afresh from the inverse; returns the tolerance of rows there."""
    n = question.cost.shape[0]
    for k in range(n):
        work.y[k] = 0.0
    for j in range(n):
        total = 0.0
        x = question.cost[j]
        for k in range(n):
            total += work.inverse[j, k] * work.rhs[k]
            work.y[k] += x * work.inverse[j, k]
        work.z[j] = total
    values(question, work.z, work.c, work.d)
    largest = 0.0
    for j in range(n):
        largest = larger(largest, abs(work.z[j]))
    return ROW_TOLERANCE + 1e-14 * largest


@quick
def imbalance(question, node, work, data, balance):
    """(scaled) energy by which the point misses the balance's tangent at node `balance` of the tree."""
    last = question.D.shape[0] - 1
    missed = -work.d[last - 1] - data[balance, question.cost.shape[0]] * work.d[last]
    for i in range(question.m):
        missed += node.normal[i] * (2.0 * work.c[3 * i] - node.normal[i]) + question.before[3 * i] * work.c[3 * i]
    return missed


@quick
def against(work, b):
    """The entering row in terms of the working set into delta; returns by how much it is missed."""
    n = work.z.shape[0]
    N = work.inverse.shape[1]
    missed = b
    for j in range(n):
        missed -= work.entering[j] * work.z[j]
    for k in range(N):
        work.delta[k] = 0.0
    for j in range(n):
        x = work.entering[j]
        if x != 0.0:
            for k in range(N):
                work.delta[k] += x * work.inverse[j, k]
    return missed


@quick
def leaving(work, least, blur):
    """The ratio test, in favour of large pivots: the row that leaves, -1 if none can."""
    n = work.z.shape[0]
    bound = np.inf
    for k in range(n):
        if work.delta[k] > least:
            bound = smaller(bound, (larger(work.y[k], 0.0) + blur) / work.delta[k])
    leave = -1
    size = 0.0
    for k in range(n):
        if work.delta[k] > least and larger(work.y[k], 0.0) <= bound * work.delta[k] and work.delta[k] > size:
            leave = k
            size = work.delta[k]
    return leave


@quick
def ray(question, work, b):
    """What the entering row, to be at least b, and the working set prove: RAY, RAY_OF_BOX or NO_RAY."""
    n = work.z.shape[0]
    total = work.pivot
    gap = b
    slip = RAY_ROUNDING * abs(b)
    cited = 1.0
    boxed = 0.0
    for j in range(n):
        x = work.entering[j]
        total[j] = x
        total[n + j] = abs(x)
    for k in range(n):
        f = work.delta[k]
        kind = work.ids[k] >> KIND_SHIFT
        if (kind in (BOX_UP, BOX_DOWN)) and not question.capped:  # nothing bounds the unknowns in truth
            boxed = larger(boxed, -f)
        elif f < 0.0:
            cited = larger(cited, -f)
            gap -= f * work.rhs[k]
            slip += RAY_ROUNDING * abs(f * work.rhs[k])
            for j in range(n):
                total[j] -= f * work.matrix[k, j]
                total[n + j] += abs(f * work.matrix[k, j])
    for j in range(n):
        slip += (2.0 * abs(total[j]) + RAY_ROUNDING * total[n + j]) * question.box[j]
    if not gap > slip:
        return NO_RAY
    return RAY if boxed <= PURE * cited else RAY_OF_BOX


@quick
def widen(work):
    """Let the program begin in a larger box."""
    for k in range(work.rhs.shape[0]):
        kind = work.ids[k] >> KIND_SHIFT
        if kind in (BOX_UP, BOX_DOWN):
            work.rhs[k] *= BOX_WIDENING


@quick
def leave_out(enter, question, node):
    """Leave out the rows of the part that this row is of; False if they are, or it is of no part."""
    part = (enter >> INDEX) & 255
    kind = enter >> KIND_SHIFT
    if T_UP <= kind <= S_UP or kind == S_DOWN:
        part += question.m
    elif S_UP < kind <= ENERGY:
        part += question.m + question.a
    if node.skip[part] or enter >> KIND_SHIFT in (BOX_UP, BOX_DOWN, ENERGY):
        return False
    node.skip[part] = True
    return True


@quick
def swap(question, work, enter, leave, b, missed):
    """Exchange the row `leave` of the working set for the row `enter`: inverse, multipliers, point and base values."""
    n = work.z.shape[0]
    inverse = work.inverse
    delta = work.delta
    scale = 1.0 / delta[leave]
    theta = larger(work.y[leave], 0.0) * scale
    step = missed * scale
    for k in range(n):
        work.y[k] -= theta * delta[k]
        work.matrix[leave, k] = work.entering[k]
    work.y[leave] = theta
    for j in range(n):
        f = inverse[j, leave]
        work.column[j] = f * step
        work.z[j] += work.column[j]
        if f != 0.0:
            f *= scale
            for k in range(inverse.shape[1]):
                inverse[j, k] -= f * delta[k]
            inverse[j, leave] = f
    blend(work.column, 0, question.DT, work.d)
    blend(work.column, question.DT.shape[0], question.CT, work.c)
    work.rhs[leave] = b
    work.ids[leave] = enter
