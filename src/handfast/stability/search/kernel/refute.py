"""Does a ray still prove what it proved, compiled: the test of `simplex.solve`, for other questions on its tree."""

from __future__ import annotations

from handfast.stability.search.arrays import EXACT, LANE, LEAVES, POOL, QUESTION, ROW, WORK
from handfast.stability.search.kernel.compiled import views
from handfast.stability.search.kernel.simplex import ROUNDING
from handfast.stability.search.kernel.values import row
from handfast.stability.search.rows import BOX_DOWN, BOX_UP, KIND


def refuted(m, a, F, cos, sin, question, lane, pool, which, work):  # type: ignore[no-untyped-def]
    """Which leaves' rays prove infeasibility as things are now, into `closed`."""
    C, D, _, _, off, mu, lo, _, box, _ = views(question, QUESTION)
    hi = views(lane, LANE)[0]
    ids, data = views(pool, POOL)[1:3]
    leaves, closed = views(which, LEAVES)
    term, total, size, _, gradient = views(work, WORK)[ROW:EXACT]
    n = box.shape[0]
    for i in range(leaves.shape[0]):
        gap = 0.0
        slip = 0.0
        for j in range(n):
            total[j] = 0.0
            size[j] = 0.0
        for k in range(n + 1):
            y = data[leaves[i], k]
            kind = ids[leaves[i], k] >> KIND
            if y <= 0.0 or kind in (BOX_UP, BOX_DOWN):
                continue
            b = row(ids[leaves[i], k], m, a, F, cos, sin, C, D, off, mu, lo, hi, box, data, term, gradient)
            gap += y * b
            slip += ROUNDING * abs(y * b)
            for j in range(n):
                total[j] += y * term[j]
                size[j] += abs(y * term[j])
        for j in range(n):
            slip += (2.0 * abs(total[j]) + ROUNDING * size[j]) * box[j]
        closed[i] = gap > slip
    return 0
