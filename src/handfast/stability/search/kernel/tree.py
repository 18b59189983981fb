"""Best-first search over contact and actuator states, compiled: programs by `simplex`, splits by `split`, incumbents by
`newton`.

A node is what every contact and actuator is (undecided, open, closed, stick, slide in a sector; free, locked,
moves) and the working set that solved its program. Expanding a node solves it once more (the cut on the
objective may have moved), splits it where its point violates the model most, and solves all children from
its working set. The inverses of the nodes made last are kept: most are split before theirs is lost. Nodes are
closed by a ray alone, which is kept too: the certificate is the tree and its rays.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner, larger, smaller
from handfast.stability.search.arrays import (
    ANY,
    CHILDREN,
    DROPS,
    EMPTY,
    ENDLESS,
    ENOUGH,
    EXHAUSTED,
    FAILURES,
    FOUND,
    HEAP,
    HITS,
    KEPT_WORKING_SETS,
    LARGEST_EFFORT,
    NEWTONS,
    NODES,
    RESTARTS,
    ROOM,
    SCALAR,
    SETTLED,
    SPLIT,
    SUM_OF_EFFORTS,
    TRIED_SPLITS,
    UNRESOLVED,
    USED,
    WAITING,
)
from handfast.stability.search.kernel.newton import refine
from handfast.stability.search.kernel.simplex import ATTEMPTS, FAILED, INFEASIBLE, OPTIMAL, invert, solve
from handfast.stability.search.kernel.smoothed_state import smoothed_state
from handfast.stability.search.kernel.split import CONE_GAP_SHARE, CONE_TOLERANCE, MIN_CONE_TOLERANCE, select, split
from handfast.stability.search.kernel.values import row, values
from handfast.stability.search.rows import BOX_DOWN, BOX_UP, INDEX, KIND_SHIFT

FIRST_NEWTON_NODES = 8  # Newton is tried on the first programs, where nothing is violated, and where little is:
# less than this share of where it was tried last, a limit that grows with every node
LESS, NEWTON_LIMIT_GROWTH = 0.25, 1.1
SMALL_VIOLATION = 1e-3
# nodes after which any state, or one at the end, is looked for in another way: few questions need as many, or very many
# more
EARLY_SEARCH_NODES, LATE_SEARCH_NODES = 16, 64
DENSE_CONTACTS = 8  # contacts from which on, and nodes: most of what such a grasp resists has no end
NEARLY = 1e-3  # motions and forces below count as none then, or below a tenth or a hundredth of this
# friction may leave its cone by as much in a program far from the model: its node is split anyway, and half of all
# exchanges were tangents of cones
LOOSE_CONE_TOLERANCE = 1e-4
WEIGHT = 1e-3  # of the violation in a node's rank
MISSED_POWER = 0.25  # power of what a part misses in the rank of those whose children are tried
AS_READ, FREED, AT_END = 0, 1, 2  # how Newton's method is tried: as a point says, or once more with the objective free,
# or at the end of the search, where a solution lies beyond it


@inner
def run(question, worker, pool, kept, node, work, room, gap, gap_absolute, budget, close):
    """Expand up to `budget` nodes; the arrays of worker and pool are the search's state and change in place.

    kept, node, work, room: what the kernel alone uses, see `Workspace`. gap, gap_absolute: by how much the next
    incumbent is to be better. close: only close what waits, by the cut in force (no splitting, no Newton).
    Returns why it stopped, EXHAUSTED to ENDLESS.
    """
    most = pool.key.shape[0] - CHILDREN - 1
    cone = larger(smaller(CONE_TOLERANCE, CONE_GAP_SHARE * gap), MIN_CONE_TOLERANCE)
    expanded = 0
    while worker.counts[HEAP] > 0:
        if expanded >= budget:
            return ENOUGH
        if worker.counts[USED] >= most:
            return ROOM
        if question.objective != ANY and not close and worker.hi[0] < question.lo[0]:
            return ENDLESS
        late = DENSE_CONTACTS if question.m >= DENSE_CONTACTS else LATE_SEARCH_NODES
        first = EARLY_SEARCH_NODES if question.objective == ANY else late
        if worker.counts[SETTLED] == 0 and worker.counts[NODES] >= first and question.objective <= SCALAR and not close:
            worker.counts[SETTLED] = 1
            if settled(question, worker, room, gap, gap_absolute) and question.objective == ANY:
                return FOUND
            continue
        this = pop(worker, pool)
        expanded += 1
        result = bound(question, worker, pool, kept, node, work, this, this, True, cone)
        if result == INFEASIBLE:
            continue
        if close:
            pool.status[this] = UNRESOLVED
        elif expand(question, worker, pool, kept, node, work, room, gap, gap_absolute, this, result, cone):
            return FOUND
    return EXHAUSTED


@inner
def expand(question, worker, pool, kept, node, work, room, gap, gap_absolute, this, result, cone):
    """Split a node whose program was solved with this result; True if any solution is sought and one was found."""
    n = question.cost.shape[0]
    pick = select(question, node, work.c, work.d, cone, node.violation[2])
    value = objective(question, work.c)
    if this == 0:
        guesses = worker.guesses.shape[0]
        if improve(question, worker, work, room, gap, gap_absolute, value, -guesses, attempts(worker, node)):
            return True
    if pick < 0:
        pool.status[this] = UNRESOLVED
        pool.bound[this] = value
        return False
    pool.status[this] = SPLIT
    # commands of the balance of energy; without an end there are none in it
    pool.data[this, n] = worker.hi[0] if question.objective != ANY and worker.hi[0] < np.inf else 0.0
    for i in range(n):
        pool.data[this, i] = work.z[i]
    for i in range(question.m):  # for the children
        node.normal[i] = work.c[3 * i]
    if result == OPTIMAL:
        keep(kept, KEPT_WORKING_SETS, this, work)
        if question.tries:
            pick = tried(question, worker, pool, kept, node, work, this, pick, value, cone)
    count = split(question, node, work.c, work.d, pick)
    for k in range(count):
        child = make_child(question, worker, pool, node, this, pick, k)
        solved = bound(question, worker, pool, kept, node, work, child, this, result == OPTIMAL, cone)
        if solved == INFEASIBLE:
            continue
        select(question, node, work.c, work.d, cone, node.violation[2])
        value = objective(question, work.c)
        if improve(question, worker, work, room, gap, gap_absolute, value, 0, attempts(worker, node)):
            return True
        pool.status[child] = WAITING
        for i in range(n):
            pool.ids[child, i] = work.ids[i]
            pool.data[child, i] = work.z[i]
        pool.bound[child] = larger(value, pool.bound[this])  # the parent's holds too: no rounding lets a bound fall
        pool.key[child] = value + WEIGHT * node.violation[0]
        push(worker, pool, child)
        if solved == OPTIMAL:
            keep(kept, child % KEPT_WORKING_SETS, child, work)
    return False


@inner
def tried(question, worker, pool, kept, node, work, this, pick, value, cone):
    """The part at which a node is split: of those that miss most, the one whose children leave least to be searched.

    A child that is empty leaves nothing, another the less the further its objective is on the way to the cut. What
    misses little counts for less: a sector can be cut without end so that one of its halves is empty.
    """
    failed = worker.counts[RESTARTS], worker.counts[DROPS], worker.counts[FAILURES]  # trials say nothing of health
    count = 0
    while count < TRIED_SPLITS:
        most = 0.0
        part = -1
        for i in range(node.missing.shape[0]):
            if node.missing[i] > most:
                most = node.missing[i]
                part = i
        if part < 0:
            break
        node.share[count] = most
        node.missing[part] = -1.0
        node.tried[count] = part
        count += 1
    if count < 2:
        return pick
    best = np.inf
    for k in range(count):
        part = node.tried[k]
        back_to(question, pool, node, work, this)
        left = 0.0
        little = (node.share[0] / node.share[k]) ** MISSED_POWER
        children = split(question, node, work.c, work.d, part)
        for child in range(children):
            if left * little >= best:
                break
            place = make_child(question, worker, pool, node, this, part, child)
            solved = bound(question, worker, pool, kept, node, work, place, this, True, cone)
            worker.counts[USED] -= 1
            worker.counts[NODES] -= 1
            if solved == INFEASIBLE:
                continue
            gain = (objective(question, work.c) - value) / larger(worker.hi[0] - value, 1e-12)
            left += (1.0 - smaller(larger(gain, 0.0), 1.0)) ** 2
        if left * little < best:
            best = left * little
            pick = part
        if best == 0.0:
            break
    worker.counts[RESTARTS], worker.counts[DROPS], worker.counts[FAILURES] = failed
    back_to(question, pool, node, work, this)
    return pick


@inner
def back_to(question, pool, node, work, this):
    """State and point of a node that was solved, after others were tried."""
    for i in range(node.state.shape[0]):
        node.state[i] = pool.states[this, i]
    for i in range(work.z.shape[0]):
        work.z[i] = pool.data[this, i]
    values(question, work.z, work.c, work.d)


@inner
def settled(question, worker, room, gap, gap_absolute):
    """Does Newton's method find a state from where equilibrium under smooth laws leads, read in several ways?

    Where a magnitude is sought, a state at the end of its range, where most dense grasps hold.
    """
    hold = question.objective == SCALAR
    if not smoothed_state(question, question.lo[0] if hold else 0.0, room):
        return False
    tolerance = NEARLY
    for _ in range(3):
        worker.counts[NEWTONS] += 1
        if refine(question, worker.hi, room, tolerance, hold) and is_better(question, worker, room, gap, gap_absolute):
            return True
        tolerance *= 0.1
    return False


@inner
def make_child(question, worker, pool, node, this, pick, k):
    """The k-th child of a node, which is split at the part `pick`, as a new row of the tree; returns its number."""
    m = question.m
    child = worker.counts[USED]
    worker.counts[USED] += 1
    worker.counts[NODES] += 1
    for i in range(3 * m + question.a):
        pool.states[child, i] = pool.states[this, i]
    pool.parent[child] = this
    pool.part[child] = pick
    if pick < m:
        pool.states[child, pick] = node.children[k, 0]
        pool.states[child, m + pick] = node.children[k, 1]
        pool.states[child, 2 * m + pick] = node.children[k, 2]
    else:
        pool.states[child, 2 * m + pick] = node.children[k, 0]
    return child


@inner
def bound(question, worker, pool, kept, node, work, this, start, warm, cone):
    """Solve the program of node `this` from the working set of node `start`, itself or its parent.

    Infeasible, it is closed by its ray. If all attempts fail, the point is that of `start`: it is split from there.
    warm: is that working set worth starting from?
    """
    n = question.cost.shape[0]
    energetic = question.D.shape[0] > question.turning + question.F - question.twist
    balance = pool.parent[this] if energetic else -1
    for i in range(3 * question.m + question.a):
        node.state[i] = pool.states[this, i]
    if balance >= 0 and this == start:  # normal forces at the parent's point, which a child has from its parent
        for i in range(question.m):
            node.normal[i] = question.off[3 * i]
            for j in range(n):
                node.normal[i] += question.C[3 * i, j] * pool.data[balance, j]
    place = start % KEPT_WORKING_SETS if this == start else KEPT_WORKING_SETS
    result = FAILED
    for attempt in range(0 if warm else 1, ATTEMPTS):
        ready = True
        if attempt == 0 and kept.owner[0, place] == start:
            take(kept, place, work)
        else:
            worker.counts[RESTARTS] += attempt > 0
            ready = rebuild(question, worker.hi, pool, work, start, attempt > 0)
        if ready:
            loose = larger(cone, LOOSE_CONE_TOLERANCE)
            result = solve(question, worker.hi, node, work, worker.counts, cone, loose, attempt, pool.data, balance)
        if result != FAILED:
            break
    if result == INFEASIBLE:
        pool.status[this] = EMPTY
        for i in range(n + 1):
            pool.ids[this, i] = work.ids[i]
            pool.data[this, i] = work.y[i]
    elif result == FAILED:
        worker.counts[FAILURES] += 1
        node.violation[2] = cone
        for i in range(n):
            work.z[i] = pool.data[start, i]
            work.ids[i] = corner(question, i)
        values(question, work.z, work.c, work.d)
    return result


@inner
def corner(question, i):
    """The i-th row of the box's corner that the cost points to: where a program starts that has no working set."""
    return ((BOX_UP if question.cost[i] >= 0.0 else BOX_DOWN) << KIND_SHIFT) | (i << INDEX)


@inner
def rebuild(question, hi, pool, work, start, afresh):
    """The working set of a node from its names, or from the corner of the box; False if it is singular."""
    work.age[0] = 0
    for i in range(question.cost.shape[0]):
        work.ids[i] = corner(question, i) if afresh else pool.ids[start, i]
        work.rhs[i] = row(work.ids[i], question, hi, pool.data, work.matrix[i], work.gradient)
    return invert(work)


@inner
def keep(kept, place, owner, work):
    """Keep a working set, for a node to be gone on from."""
    kept.owner[0, place] = owner
    kept.owner[1, place] = work.age[0]
    for i in range(work.rhs.shape[0]):
        kept.ids[place, i] = work.ids[i]
        kept.rhs[place, i] = work.rhs[i]
        for j in range(work.rhs.shape[0]):
            kept.matrix[place, i, j] = work.matrix[i, j]
        for j in range(work.inverse.shape[1]):
            kept.inverse[place, i, j] = work.inverse[i, j]


@inner
def take(kept, place, work):
    """Go on from a working set that was kept."""
    work.age[0] = kept.owner[1, place]
    for i in range(work.rhs.shape[0]):
        work.ids[i] = kept.ids[place, i]
        work.rhs[i] = kept.rhs[place, i]
        for j in range(work.rhs.shape[0]):
            work.matrix[i, j] = kept.matrix[place, i, j]
        for j in range(work.inverse.shape[1]):
            work.inverse[i, j] = kept.inverse[place, i, j]


@inner
def attempts(worker, node):
    """How often Newton's method is to be tried from a node's point, by its violation."""
    count = 0
    if node.violation[1] == 0.0:
        count = 4
    elif worker.counts[NODES] <= FIRST_NEWTON_NODES or node.violation[0] < worker.best[1]:
        count = 1
    worker.best[1] = (
        LESS * larger(node.violation[0], SMALL_VIOLATION) if count > 0 else NEWTON_LIMIT_GROWTH * worker.best[1]
    )
    return count


@inner
def improve(question, worker, work, room, gap, gap_absolute, value, first, tries):
    """Newton's method from guesses (those with numbers below 0, from `first` on) and then, `tries` times with ever
    larger tolerances, from the point of `work`. True if any solution is sought and one was found.

    value: the objective at that point.
    """
    n = question.cost.shape[0]
    end = question.lo[0] if question.objective == SCALAR else 0.0
    trying = first
    tolerance = 1e-6
    hold = False
    how = AS_READ
    while trying < tries:
        if how == AS_READ:
            hold = question.objective == SCALAR and trying >= 0 and value <= end + 1e-6 * abs(end)
            for j in range(n):
                room.start[j] = worker.guesses[trying - first, j] if trying < 0 else work.z[j]
        worker.counts[NEWTONS] += 1
        hit = refine(question, worker.hi, room, tolerance, hold)
        if how == AS_READ and hold and not hit:
            how = FREED
            hold = False
            continue
        if hit and question.objective == SCALAR and not hold and objective(question, room.c) < end and how != AT_END:
            how = AT_END
            hold = True
            for j in range(n):
                room.start[j] = room.z[j]
            continue
        if hit and is_better(question, worker, room, gap, gap_absolute) and question.objective == ANY:
            return True
        how = AS_READ
        if trying >= 0:
            tolerance = 1e-8 if trying == 2 else tolerance * 100.0
        trying += 1
    return False


@inner
def is_better(question, worker, room, gap, gap_absolute):
    """Is an exact solution better than the incumbent? It takes its place then, and the cut moves."""
    found = achieved(question, room)
    if question.objective == SCALAR and not found >= question.lo[0] - 1e-9 * abs(question.lo[0]):
        return False
    if question.objective != ANY and worker.best[0] == np.inf and found > worker.hi[0]:
        return False  # Newton's method does not know the scalar's other end
    if not found < worker.best[0]:
        return False
    worker.counts[HITS] += 1
    worker.best[0] = found
    for j in range(room.z.shape[0]):
        worker.best_z[j] = room.z[j]
    if question.objective != ANY:
        worker.hi[0] = smaller(worker.hi[0], found - gap * abs(found) - gap_absolute)
    none = question.least * (question.a if question.objective == SUM_OF_EFFORTS else 1)
    if question.objective > SCALAR and found <= (1.0 + gap) * none:
        worker.hi[0] = question.lo[0] - 1.0  # nothing is less: the search ends
    return True


@inner
def objective(question, c):
    """Of a point with these forces, 0 if any solution is sought."""
    return c[3 * question.m + 2 * question.a] if question.objective != ANY else 0.0


@inner
def achieved(question, room):
    """What an exact solution achieves: its scalar, or the effort of the driven actuators that turn."""
    m = question.m
    a = question.a
    if question.objective == SCALAR:
        return room.c[3 * m + 2 * a]
    total = 0.0
    effort = question.twist
    for j in range(a):
        effort -= 1 if question.driven[j] else 0
    for j in range(a):
        if question.driven[j]:
            if room.d[3 * m + j] > 1e-12:
                left = room.c[3 * m + 2 * j + 1]
                if question.objective == LARGEST_EFFORT:
                    total = larger(total, room.c[3 * m + 2 * a] - left)
                elif question.objective == SUM_OF_EFFORTS:
                    total += larger(room.c[effort] - left, 0.0)
            effort += 1
    return total


@inner
def push(worker, pool, node):
    """Into the heap of waiting nodes, smallest rank first."""
    heap = worker.heap
    k = worker.counts[HEAP]
    worker.counts[HEAP] += 1
    while k > 0:
        up = (k - 1) // 2
        if pool.key[heap[up]] <= pool.key[node]:
            break
        heap[k] = heap[up]
        k = up
    heap[k] = node


@inner
def pop(worker, pool):
    """The waiting node with the smallest rank."""
    heap = worker.heap
    first = heap[0]
    worker.counts[HEAP] -= 1
    n = worker.counts[HEAP]
    last = heap[n]
    k = 0
    while 2 * k + 1 < n:
        low = 2 * k + 1
        if low + 1 < n and pool.key[heap[low + 1]] < pool.key[heap[low]]:
            low += 1
        if pool.key[last] <= pool.key[heap[low]]:
            break
        heap[k] = heap[low]
        k = low
    heap[k] = last
    return first
