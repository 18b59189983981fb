"""Best-first search over contact and actuator states, compiled: programs by `simplex`, splits by
`branch`, incumbents by `newton`.

A node is what every contact and actuator is (undecided, open, closed, stick, slide in a sector; free, locked,
moves) and the working set that solved its program. Expanding a node solves it once more (the bound on the
objective may have moved), splits it where its point violates the model most, and solves all children from
its working set. The inverses of the nodes made last are kept: most are split before theirs is lost. Nodes are
closed by a ray alone, which is kept too: the certificate is the tree and its rays.

The state of a node is one row of integers: m contacts, m left sector ends, m right ends, the actuators.
"""

from __future__ import annotations

import numpy as np

from handfast.stability.search.arrays import (
    ANY,
    EMPTY,
    ENDLESS,
    ENOUGH,
    EXHAUSTED,
    FAILURES,
    FOUND,
    HEAP,
    HITS,
    KEPT,
    LANE,
    LARGEST_EFFORT,
    NEWTONS,
    NODES,
    POOL,
    QUESTION,
    RESTARTS,
    ROOM,
    SCALAR,
    SPLIT,
    SUM_OF_EFFORTS,
    UNRESOLVED,
    USED,
    WAITING,
    WORK,
)
from handfast.stability.search.kernel import branch, newton, simplex
from handfast.stability.search.kernel.compiled import inner, larger, smaller, views
from handfast.stability.search.kernel.values import row, values
from handfast.stability.search.rows import BOX_DOWN, BOX_UP, INDEX, KIND

FIRST = 8  # Newton is tried on the first programs, where nothing is violated, and where little is:
LESS, MORE = 0.5, 1.1  # less than this share of where it was tried last, a limit that grows with every node
LITTLE = 1e-3
WEIGHT = 1e-3  # of the violation in a node's rank


@inner
def corner(cost, i):  # type: ignore[no-untyped-def]
    """The i-th row of the box's corner that the cost points to: where a program starts that has no working set."""
    return ((BOX_UP if cost[i] >= 0.0 else BOX_DOWN) << KIND) | (i << INDEX)


@inner
def push(heap, key, stats, node):  # type: ignore[no-untyped-def]
    """Into the heap of waiting nodes, smallest key first."""
    k = stats[HEAP]
    stats[HEAP] += 1
    while k > 0:
        up = (k - 1) // 2
        if key[heap[up]] <= key[node]:
            break
        heap[k] = heap[up]
        k = up
    heap[k] = node


@inner
def pop(heap, key, stats):  # type: ignore[no-untyped-def]
    """The waiting node with the smallest key."""
    first = heap[0]
    stats[HEAP] -= 1
    n = stats[HEAP]
    last = heap[n]
    k = 0
    while 2 * k + 1 < n:
        low = 2 * k + 1
        if low + 1 < n and key[heap[low + 1]] < key[heap[low]]:
            low += 1
        if key[last] <= key[heap[low]]:
            break
        heap[k] = heap[low]
        k = low
    heap[k] = last
    return first


@inner
def copy(ids, rhs, W, T, to_ids, to_rhs, to_W, to_T):  # type: ignore[no-untyped-def]
    """A working set, to be gone on from."""
    n = rhs.shape[0]
    for i in range(n):
        to_ids[i] = ids[i]
        to_rhs[i] = rhs[i]
        for j in range(n):
            to_W[i, j] = W[i, j]
        for j in range(T.shape[1]):
            to_T[i, j] = T[i, j]


@inner
def achieved(m, a, F, objective, driven, c, d):  # type: ignore[no-untyped-def]
    """What an exact solution achieves: its scalar, or the effort of the driven actuators that turn."""
    if objective == SCALAR:
        return c[3 * m + 2 * a]
    total = 0.0
    effort = F
    for j in range(a):
        effort -= 1 if driven[j] else 0
    for j in range(a):
        if driven[j]:
            if d[3 * m + j] > 1e-12:
                left = c[3 * m + 2 * j + 1]
                if objective == LARGEST_EFFORT:
                    total = larger(total, c[3 * m + 2 * a] - left)
                elif objective == SUM_OF_EFFORTS:
                    total += c[effort] - left
            effort += 1
    return total


def run(  # type: ignore[no-untyped-def]
    m, a, F, cos, sin, mdp, objective, capped, gap, gap_absolute, budget, close, question, lane, pool, work
):
    """Expand up to `budget` nodes; the arrays of lane and pool are the search's state and change in place.

    question: C, D, CT, DT, off, mu, lo, cost, box, driven of `reduced`.
    lane: hi, best, best_z, stats, guess, heap. best (2,): the smallest objective found, from which the cut
    hi[0] follows, and the violation below which Newton is tried. guess (g, n): points to start Newton from.
    pool: states, ids, data, key, bound, parent, part, status. Node k has its state in states[k] (3m + a), its
    working set in ids[k] (n + 1), and in data[k] (n + 1) its point while it waits, its ray's multipliers once it is
    empty.
    work: see `arrays.room`.
    capped: the box holds for motions up to a cap, and rays may cite it.
    close: only close what waits, by the cut in force (no splitting, no Newton). Returns why it stopped.
    """
    C, D, CT, DT, off, mu, lo, cost, box, driven = views(question, QUESTION)
    hi, best, best_z, stats, guess, heap = views(lane, LANE)
    states, ids, data, key, bound, parent, part, status = views(pool, POOL)
    (
        owner, kept_ids, kept_rhs, kept_W, kept_T,
        state, child, skip, trig, amounts, normal,
        w_ids, order, age, rhs, W, T, y, z, c, d, enter_row, column, pivot, delta, gradient,
        modes, motors, side, exact_z, exact_c, exact_d, G, J, g, q, size, start, step, trial,
    ) = views(work, WORK)  # fmt: skip
    n = cost.shape[0]
    scalar = 3 * m + 2 * a
    room = key.shape[0] - 5
    cone = larger(smaller(branch.CONE, branch.FINER * gap), branch.FINEST)
    energetic = lo.shape[0] > 0 and lo[lo.shape[0] - 1] == -np.inf
    first = 0 if objective == ANY else 1  # of the plain values, the first that limits something
    expanded = 0
    guesses = guess.shape[0]
    while stats[HEAP] > 0:
        if expanded >= budget:
            return ENOUGH
        if stats[USED] >= room:
            return ROOM
        if objective != ANY and not close and hi[0] < lo[0]:
            return ENDLESS
        node = pop(heap, key, stats)
        expanded += 1
        children = 0
        pick = -1
        warm = True  # is the node's working set worth starting from?
        k = 0
        while k <= children:
            # 0: the node itself from its own working set; k: its k-th child from the node's
            this = node
            if k > 0:
                this = stats[USED]
                stats[USED] += 1
                stats[NODES] += 1
                for i in range(3 * m + a):
                    states[this, i] = states[node, i]
                parent[this] = node
                part[this] = pick
                if pick < m:
                    states[this, pick] = child[k - 1, 0]
                    states[this, m + pick] = child[k - 1, 1]
                    states[this, 2 * m + pick] = child[k - 1, 2]
                else:
                    states[this, 2 * m + pick] = child[k - 1, 0]
            for i in range(3 * m + a):
                state[i] = states[this, i]
            balance = parent[this] if energetic else -1
            for i in range(m if balance >= 0 and k == 0 else 0):  # normal forces at the parent's point
                normal[i] = off[3 * i]
                for j in range(n):
                    normal[i] += C[3 * i, j] * data[balance, j]
            result = simplex.FAILED
            for attempt in range(0 if warm or k == 0 else 1, simplex.ATTEMPTS):
                ready = True
                slot = node % KEPT if k == 0 else KEPT
                if attempt == 0 and owner[0, slot] == node:
                    age[0] = owner[1, slot]
                    copy(kept_ids[slot], kept_rhs[slot], kept_W[slot], kept_T[slot], w_ids, rhs, W, T)
                else:
                    age[0] = 0
                    stats[RESTARTS] += attempt > 0
                    for i in range(n):
                        w_ids[i] = ids[node, i]
                        if attempt > 0:
                            w_ids[i] = corner(cost, i)
                        rhs[i] = row(w_ids[i], m, a, F, cos, sin, C, D, off, mu, lo, hi, box, data, W[i], gradient)
                    ready = simplex.invert(W, T, order, pivot)
                if ready:
                    result = simplex.solve(
                        m, a, F, cos, sin, C, D, CT, DT, off, mu, lo, hi, box, capped != 0, cost, driven, state,
                        trig, skip, w_ids, W, rhs, T, order, y, z, c, d, enter_row, column, pivot, gradient, delta,
                        stats, age, cone, attempt, data, balance, normal,
                    )  # fmt: skip
                if result != simplex.FAILED:
                    break
            if result == simplex.INFEASIBLE:
                status[this] = EMPTY
                for i in range(n + 1):
                    ids[this, i] = w_ids[i]
                    data[this, i] = y[i]
                if k == 0:
                    break
                k += 1
                continue
            if result == simplex.FAILED:
                stats[FAILURES] += 1
                for i in range(n):  # keep the point it had, or its parent's: it is split from there
                    z[i] = data[node, i]
                    w_ids[i] = corner(cost, i)
                values(CT, DT, off, z, c, d)
            if k == 0 and close:
                status[this] = UNRESOLVED
                break
            target = branch.select(m, a, cos, sin, mdp, mu, driven, state, c, d, cone, amounts)
            value = c[scalar] if objective != ANY else 0.0

            tries = 0
            if k > 0 or node == 0:
                if amounts[1] == 0.0:
                    tries = 4
                elif stats[NODES] <= FIRST or amounts[0] < best[1]:
                    tries = 1
                best[1] = LESS * larger(amounts[0], LITTLE) if tries > 0 else MORE * best[1]
            trying = -guesses if node == 0 and k == 0 else 0
            hold = False
            past = 0  # starts beyond the end of the search, to be tried again right at it
            tol = 1e-6
            while trying < tries:
                if past == 0:
                    hold = objective == SCALAR and trying >= 0 and value <= lo[0] + 1e-6 * abs(lo[0])
                    for j in range(n):
                        start[j] = guess[guesses + trying, j] if trying < 0 else z[j]
                stats[NEWTONS] += 1
                hit = newton.polish(
                    m, a, cos, sin, mdp, first, C, D, CT, DT, off, mu, lo, hi, driven, hold, tol, start,
                    exact_z, exact_c, exact_d, modes, motors, side, G, J, g, q, size, step, trial, enter_row, delta,
                )  # fmt: skip
                if past == 0 and hold and not hit:
                    past = 1
                    hold = False
                    continue
                if hit and objective == SCALAR and not hold and exact_c[scalar] < lo[0] and past < 2:
                    past = 2
                    hold = True
                    for j in range(n):
                        start[j] = exact_z[j]
                    continue
                if hit:
                    found = achieved(m, a, F, objective, driven, exact_c, exact_d)
                    allowed = objective != SCALAR or found >= lo[0] - 1e-9 * abs(lo[0])
                    if best[0] == np.inf and found > hi[0]:  # Newton's method does not know the scalar's other end
                        allowed = objective == ANY
                    if found < best[0] and allowed:
                        stats[HITS] += 1
                        best[0] = found
                        for j in range(n):
                            best_z[j] = exact_z[j]
                        if objective == ANY:
                            return FOUND
                        hi[0] = smaller(hi[0], found - gap * abs(found) - gap_absolute)
                past = 0
                if trying >= 0:
                    tol = 1e-8 if trying == 2 else tol * 100.0
                trying += 1

            if k == 0:
                if target < 0:
                    status[node] = UNRESOLVED
                    bound[node] = value
                    break
                status[node] = SPLIT
                data[node, n] = hi[0] if objective != ANY else 0.0
                warm = result == simplex.OPTIMAL
                for i in range(m):  # for the children
                    normal[i] = c[3 * i]
                for i in range(n):
                    data[node, i] = z[i]
                pick = target
                children = branch.split(m, state, c, d, pick, child)
            else:
                status[this] = WAITING
                for i in range(n):
                    ids[this, i] = w_ids[i]
                    data[this, i] = z[i]
                bound[this] = larger(value, bound[node])  # the parent's holds too: no rounding lets a bound fall
                key[this] = value + WEIGHT * amounts[0]
                push(heap, key, stats, this)
            if result == simplex.OPTIMAL:
                slot = this % KEPT if k > 0 else KEPT
                owner[0, slot] = this
                owner[1, slot] = age[0]
                copy(w_ids, rhs, W, T, kept_ids[slot], kept_rhs[slot], kept_W[slot], kept_T[slot])
            k += 1
    return EXHAUSTED
