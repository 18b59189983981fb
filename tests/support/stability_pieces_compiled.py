"""The functions of `stability_pieces`."""

from __future__ import annotations

from handfast.core.compiled import inner
from handfast.proofs import kinds
from handfast.stability.search import rows
from handfast.stability.search.kernel import newton, simplex, tree
from handfast.stability.search.kernel.patch import patch
from handfast.stability.search.kernel.smoothed_state import smoothed_state
from handfast.stability.search.kernel.values import row, values


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
    id = kinds.ENERGY << rows.KIND_SHIFT
    balance.rhs[0] = row(id, question, balance.hi, balance.data, balance.row, balance.gradient)
    return 0


@inner
def patched(number, out):
    patch(number, out.numbers, 0)
    return 0


@inner
def contact_equations(i, question, room):
    """Residuals and gradients of contact i at the forces, motions and modes in `room`; how many."""
    if question.soft[i] >= 0:
        return newton.soft_finger(i, question, 0, room)
    return newton.contact(i, question, 0, room)


@inner
def smoothed(question, room):
    """Where smooth laws lead, and the forces and motions there."""
    if not smoothed_state(question, 0.0, room):
        return 0
    values(question, room.start, room.c, room.d)
    return 1
