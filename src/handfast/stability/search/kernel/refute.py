"""Does a ray still prove what it proved, compiled: the test of `simplex`, for other questions on its tree."""

from __future__ import annotations

from handfast.core.compiled import inner
from handfast.stability.search.kernel.simplex import ROUNDING
from handfast.stability.search.kernel.values import row
from handfast.stability.search.rows import BOX_DOWN, BOX_UP, KIND


@inner
def refuted(question, worker, pool, leaves, work):
    """Which leaves' rays prove infeasibility as things are now, into `leaves.closed`; of `work` only room is used."""
    n = question.box.shape[0]
    term, total, size = work.entering, work.column, work.pivot
    for i in range(leaves.nodes.shape[0]):
        node = leaves.nodes[i]
        gap = 0.0
        slip = 0.0
        for j in range(n):
            total[j] = 0.0
            size[j] = 0.0
        for k in range(n + 1):
            y = pool.data[node, k]
            kind = pool.ids[node, k] >> KIND
            if y <= 0.0 or kind in (BOX_UP, BOX_DOWN):
                continue
            b = row(pool.ids[node, k], question, worker.hi, pool.data, term, work.gradient)
            gap += y * b
            slip += ROUNDING * abs(y * b)
            for j in range(n):
                total[j] += y * term[j]
                size[j] += abs(y * term[j])
        for j in range(n):
            slip += (2.0 * abs(total[j]) + ROUNDING * size[j]) * question.box[j]
        leaves.closed[i] = gap > slip
    return 0
