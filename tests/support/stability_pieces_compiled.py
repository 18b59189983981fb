"""The functions of `stability_pieces`."""

from __future__ import annotations

from handfast.core.compiled import inner
from handfast.stability.search import rows
from handfast.stability.search.kernel import simplex, tree
from handfast.stability.search.kernel.values import row


@inner
def solved(question, counted, node, work, points, cone):
    """Solve a node's program from its first working set, in as many attempts as the search makes."""
    result = simplex.FAILED
    for attempt in range(simplex.ATTEMPTS):
        work.age[0] = 0
        tree.rebuild(question, counted.hi, points, work, 0, True)
        result = simplex.solve(question, counted.hi, node, work, counted.counts, cone, cone, attempt, points.data, -1)
        if result != simplex.FAILED:
            break
    return result


@inner
def balanced(question, balance):
    id = rows.ENERGY << rows.KIND_SHIFT
    balance.rhs[0] = row(id, question, balance.hi, balance.data, balance.row, balance.gradient)
    return 0
