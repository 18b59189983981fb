"""Best-first search over contact and actuator states, compiled: programs by `simplex`, splits by
`branch`, incumbents by `newton`.

A node is what every contact and actuator is (undecided, open, closed, stick, slide in a sector; free, locked,
moves) and the working set that solved its program. Expanding a node solves it once more (the bound on the
objective may have moved), splits it where its point violates the model most, and solves all children from
its working set: so a node is factorised once, and an infeasible child never is. Nodes are closed by a ray
alone, which is kept: the certificate is the tree and its rays.

The state of a node is one row of integers: m contacts, m left sector ends, m right ends, the actuators.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from holdfast.stability.engine import branch, newton, simplex
from holdfast.stability.engine.rows import (
    BOX_DOWN,
    BOX_UP,
    INDEX,
    KIND,
    inner,
    row,
    values,
)

# what became of a node
WAITING, SPLIT, EMPTY, UNRESOLVED = 0, 1, 2, 3
# why `run` returned
EXHAUSTED, ENOUGH, ROOM, FOUND, ENDLESS = 0, 1, 2, 3, 4

FIRST = 8  # Newton is tried on the first programs, where nothing is violated, and where little is:
LESS, MORE = 0.5, 1.1  # less than this share of where it was tried last, a limit that grows with every node
LITTLE = 1e-3
WEIGHT = 1e-3  # of the violation in a node's rank

# what is sought
ANY, SCALAR, LARGEST_EFFORT, SUM_OF_EFFORTS = 0, 1, 2, 3

# places in `stats`
NODES, EXCHANGES, DROPS, RESTARTS, NEWTONS, HITS, USED, HEAP, FAILURES = 0, 1, 2, 3, 4, 5, 6, 7, 8


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
def achieved(m, a, objective, driven, v, plain):  # type: ignore[no-untyped-def]
    """What an exact solution achieves: its scalar, or the effort of the driven actuators that turn."""
    if objective == SCALAR:
        return v[plain]
    total = 0.0
    effort = v.shape[0]
    for j in range(a):
        effort -= 1 if driven[j] else 0
    for j in range(a):
        if driven[j]:
            if v[6 * m + 3 * j] > 1e-12:
                left = v[6 * m + 3 * j + 2]
                if objective == LARGEST_EFFORT:
                    total = max(total, v[plain] - left)
                elif objective == SUM_OF_EFFORTS:
                    total += v[effort] - left
            effort += 1
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def run(  # type: ignore[no-untyped-def]
    m, a, cos, sin, mdp, objective, motions, gap, gap_absolute,
    B, BT, off, mu, lo, hi, box, cost, driven,
    budget, close, guess, best, best_z, stats,
    states, ids, data, key, bound, parent, part, status, heap,
):  # fmt: skip
    """Expand up to `budget` nodes; all arrays are the search's state and change in place.

    Node k has its state in states[k] (3m + a), its working set in ids[k] (n + 1), and in data[k] (n + 1) its
    point while it waits, its ray's multipliers once it is empty. best (2,): the smallest objective found,
    from which the cut hi[0] follows, and the violation below which Newton is tried. guess (g, n): points to start
    Newton from. close: only close what waits, by the cut in force (no splitting, no Newton). Returns why it stopped.
    """
    n = BT.shape[0]
    nb = off.shape[0]
    plain = nb - lo.shape[0]
    room = key.shape[0] - 5
    most = 4 * m + 2 * a + lo.shape[0]
    state = np.empty(3 * m + a, np.int64)
    child = np.empty((4, 3), np.int64)
    skip = np.empty(m + a + lo.shape[0], np.bool_)
    modes = np.empty(m, np.int64)
    motors = np.empty(a, np.int64)
    side = np.empty(lo.shape[0], np.int64)
    w_ids = np.empty(n + 1, np.int64)
    p_ids = np.empty(n + 1, np.int64)
    W = np.empty((n, n))
    p_W = np.empty((n, n))
    edges = np.empty((n, n + nb))
    p_edges = np.empty((n, n + nb))
    pivot = np.empty(n + nb)
    gradient = np.empty(6)
    trig = np.empty((m, 4))
    G = np.empty((4, 6))
    J = np.empty((most, n))
    v = np.empty(nb)
    exact_v = np.empty(nb)
    rhs = np.empty(n)
    p_rhs = np.empty(n)
    y = np.empty(n + 1)
    z = np.empty(n)
    enter_row = np.empty(n)
    delta = np.empty(n)
    start = np.empty(n)
    exact_z = np.empty(n)
    step = np.empty(n)
    trial = np.empty(n)
    g = np.empty(most)
    q = np.empty(most)
    size = np.empty(most)
    amounts = np.empty(2)

    cone = max(min(branch.CONE, branch.FINER * gap), branch.FINEST)
    energetic = lo.shape[0] > 0 and lo[lo.shape[0] - 1] == -np.inf
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
            result = simplex.FAILED
            for attempt in range(0 if warm or k == 0 else 1, 2):
                ready = True
                if k > 0 and attempt == 0:
                    for i in range(n):
                        w_ids[i] = p_ids[i]
                        rhs[i] = p_rhs[i]
                        for j in range(n):
                            W[i, j] = p_W[i, j]
                        for j in range(n + nb):
                            edges[i, j] = p_edges[i, j]
                else:
                    stats[RESTARTS] += attempt
                    for i in range(n):
                        w_ids[i] = ids[node, i]
                        if attempt == 1:
                            w_ids[i] = corner(cost, i)
                        rhs[i] = row(w_ids[i], m, cos, sin, B, off, mu, lo, hi, box, data, W[i], gradient)
                    ready = simplex.invert(W, BT, edges, pivot)
                if ready:
                    result = simplex.solve(
                        m, a, cos, sin, B, BT, off, mu, lo, hi, box, cost, driven, state, trig, skip,
                        w_ids, W, rhs, edges, y, z, v, enter_row, pivot, gradient, delta, stats,
                        cone, attempt == 0, data, balance,
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
                values(BT, off, z, v)
            if k == 0 and close:
                status[this] = UNRESOLVED
                break
            target = branch.select(m, a, cos, sin, mdp, mu, driven, state, v, cone, amounts)
            value = v[plain] if objective != ANY else 0.0

            tries = 0
            if k > 0 or node == 0:
                if amounts[1] == 0.0:
                    tries = 4
                elif stats[NODES] <= FIRST or amounts[0] < best[1]:
                    tries = 1
                best[1] = LESS * max(amounts[0], LITTLE) if tries > 0 else MORE * best[1]
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
                    m, a, cos, sin, mdp, min(objective, 1), motions, B, BT, off, mu, lo, hi, driven, hold, tol, start,
                    exact_z, exact_v, modes, motors, side, G, J, g, q, size, step, trial, enter_row, delta,
                )  # fmt: skip
                if past == 0 and hold and not hit:
                    past = 1
                    hold = False
                    continue
                if hit and objective == SCALAR and not hold and exact_v[plain] < lo[0] and past < 2:
                    past = 2
                    hold = True
                    for j in range(n):
                        start[j] = exact_z[j]
                    continue
                if hit:
                    found = achieved(m, a, objective, driven, exact_v, plain)
                    if found < best[0] and (objective != SCALAR or found >= lo[0] - 1e-9 * abs(lo[0])):
                        stats[HITS] += 1
                        best[0] = found
                        for j in range(n):
                            best_z[j] = exact_z[j]
                        if objective == ANY:
                            return FOUND
                        hi[0] = min(hi[0], found - gap * abs(found) - gap_absolute)
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
                for i in range(n):
                    p_ids[i] = w_ids[i]
                    p_rhs[i] = rhs[i]
                    data[node, i] = z[i]
                    for j in range(n):
                        p_W[i, j] = W[i, j]
                    for j in range(n + nb):
                        p_edges[i, j] = edges[i, j]
                pick = target
                children = branch.split(m, state, v, pick, child)
            else:
                status[this] = WAITING
                for i in range(n):
                    ids[this, i] = w_ids[i]
                    data[this, i] = z[i]
                bound[this] = max(value, bound[node])  # the parent's holds too: no rounding lets a bound fall
                key[this] = value + WEIGHT * amounts[0]
                push(heap, key, stats, this)
            k += 1
    return EXHAUSTED
