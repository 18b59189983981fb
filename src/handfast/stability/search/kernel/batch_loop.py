"""Many questions about one grasp in turn, compiled: each row of `QuestionRows` is put into the question and searched.

What differs between rows is the load: constants of the forces, bounds, two rows of motions, and where a disturbance
is sought one column of forces. A row whose search does not end as it should is left to a whole search (`HARD`), but
for one that is as long as that may be (`LIMITED`).
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner, larger, smaller
from handfast.stability.search.arrays import (
    ANY,
    DROPS,
    ENOUGH,
    FAILURES,
    FOUND,
    HARD,
    HEAP,
    HELD,
    LIMITED,
    NODES,
    NONE,
    PREFERENCE,
    RESTARTS,
    ROOM,
    SCALAR,
    UNASKED,
    UNRESOLVED,
    USED,
    WAITING,
    WORKER_COUNTS,
)
from handfast.stability.search.kernel.newton import refine
from handfast.stability.search.kernel.tree import corner, is_better, run

NEWTON_GUESSES = 2  # solutions of rows before, from which Newton's method is tried first where any state will do
NEGLIGIBLE_MOTION = 1e-6  # (scaled) below which motions and forces of theirs count as none
ROW_SLICE_NODES = 64  # nodes between two looks at how many programs fail,
MIN_FAILURE_NODES, MAX_FAILURE_SHARE = 128, 0.2  # from so many on: this share is too much
# relative distance of the first cut that is to close what waits; of the next
FIRST_CUT_DISTANCE, CUT_GROWTH, MAX_CUTS = 1e-6, 50.0, 4
RANGE_END_TOLERANCE = 1e-6  # relative: an objective so near the first of its range is at its end


@inner
def ask_rows(question, worker, pool, kept, node, work, room, rows, gap, gap_absolute, inside, budget, limit):
    """Ask the rows that are unasked.

    The other groups are those of `tree.run`; question and worker are written over. inside: by which share a solution
    with a scalar is moved off the largest one, see `front._inside`. budget: nodes that are expanded for one row. limit:
    of its nodes, for a whole search.
    """
    for i in range(rows.status.shape[0]):
        if rows.status[i] != UNASKED:
            continue
        pose(question, worker, rows, i)
        if question.objective == ANY and known(question, worker, room, rows, i):
            rows.status[i] = HELD
            rows.nodes[i] = 0
        else:
            begin(question, worker, pool, kept)
            rows.status[i] = searched(question, worker, pool, kept, node, work, room, gap, gap_absolute, budget)
            rows.nodes[i] = worker.counts[NODES] + 1
            ends = rows.status[i] == HARD and question.objective == SCALAR and rows.nodes[i] >= limit
            if ends and closed(question, worker, pool, kept, node, work, room, gap, gap_absolute):
                rows.status[i] = LIMITED
        rows.best[i] = worker.best[0]
        rows.cut[i] = worker.hi[0] if worker.hi.shape[0] > 0 else 0.0
        for j in range(worker.best_z.shape[0]):
            rows.z[i, j] = worker.best_z[j]
        if rows.status[i] == HELD and question.objective == SCALAR:
            move_inside(question, worker, room, rows, i, inside)
    return 0


@inner
def pose(question, worker, rows, i):
    """Put a row's load into the question and its bounds into the worker, which knows nothing then."""
    for k in range(rows.off.shape[1]):
        question.off[k] = rows.off[i, k]
    for k in range(rows.lo.shape[1]):
        question.lo[k] = rows.lo[i, k]
        worker.hi[k] = rows.hi[i, k]
    of_energy = rows.energy.shape[1]
    for b in range(of_energy):
        place = question.D.shape[0] - of_energy + b
        for j in range(rows.energy.shape[2]):
            question.D[place, j] = rows.energy[i, b, j]
            question.DT[j, place] = rows.energy[i, b, j]
    if rows.column.shape[1] > 0:
        pose_column(question, rows, i)
    worker.best[0] = np.inf
    worker.best[1] = np.inf


@inner
def pose_column(question, rows, i):
    """The forces and the cost where a row adds a column of its own, see `template`."""
    nu = question.DT.shape[0]
    top = 3 * question.m + 2 * question.a
    for j in range(rows.mix.shape[0]):
        cost = 0.0
        for k in range(question.F):
            x = rows.plain[k, j] + rows.column[i, k] * rows.mix[j]
            question.C[k, nu + j] = x
            question.CT[j, k] = x
            if k < 3 * question.m and k % 3 == 0:
                cost += PREFERENCE * x
            elif k == top:
                cost += x
        question.cost[nu + j] = cost + (rows.noise[j] if cost >= 0.0 else -rows.noise[j])


@inner
def known(question, worker, room, rows, i):
    """Does Newton's method find a state from rest, or from the states of rows before whose loads are nearest?"""
    n = question.cost.shape[0]
    last = -1
    before = -1.0
    for attempt in range(NEWTON_GUESSES + 1):
        pick = -1
        if attempt > 0:
            least = np.inf
            for k in range(i):
                if rows.status[k] != HELD:
                    continue
                distance = 0.0
                for j in range(rows.load.shape[1]):
                    distance += (rows.load[k, j] - rows.load[i, j]) ** 2
                if distance < least and (distance > before or (distance == before and k > last)):
                    least = distance
                    pick = k
            if pick < 0:
                return False
            last = pick
            before = least
        for j in range(n):
            room.start[j] = rows.z[pick, j] if pick >= 0 else 0.0
        hold = question.objective == SCALAR  # no literal, for which all would be compiled once more
        if refine(question, worker.hi, room, NEGLIGIBLE_MOTION, hold) and is_better(question, worker, room, 0.0, 0.0):
            return True
    return False


@inner
def begin(question, worker, pool, kept):
    """A tree with nothing but its root."""
    n = question.cost.shape[0]
    for k in range(len(WORKER_COUNTS)):
        worker.counts[k] = 0
    worker.counts[USED] = 1
    worker.counts[HEAP] = 1
    worker.heap[0] = 0
    for k in range(kept.owner.shape[1]):
        kept.owner[0, k] = -1
    for k in range(pool.states.shape[1]):
        pool.states[0, k] = 0
    for j in range(n):
        pool.ids[0, j] = corner(question, j)
        pool.data[0, j] = 0.0
    pool.key[0] = 0.0
    pool.bound[0] = question.lo[0] if question.objective != ANY else 0.0
    pool.parent[0] = -1
    pool.part[0] = 0
    pool.status[0] = WAITING


@inner
def searched(question, worker, pool, kept, node, work, room, gap, gap_absolute, budget):
    """`HELD`, `NONE` or `HARD`: what a search from its root shows."""
    spent = 0
    close = budget < 0
    while True:
        slice_ = smaller(ROW_SLICE_NODES, budget)
        why = run(question, worker, pool, kept, node, work, room, gap, gap_absolute, slice_, close)
        if why == FOUND:
            return HELD
        spent += ROW_SLICE_NODES
        nodes = worker.counts[NODES] + 1
        failed = worker.counts[RESTARTS] + worker.counts[DROPS] + worker.counts[FAILURES]
        if why != ENOUGH:
            break
        if spent >= budget or (nodes >= MIN_FAILURE_NODES and failed >= MAX_FAILURE_SHARE * nodes):
            return HARD
    if why == ROOM:
        return HARD
    for k in range(worker.counts[USED]):
        if pool.status[k] == UNRESOLVED:
            return HARD
    return HELD if worker.best[0] < np.inf else NONE


@inner
def closed(question, worker, pool, kept, node, work, room, gap, gap_absolute):
    """Does a cut below the bounds of what waits close all of it, as in `Search.close`? It is the worker's then."""
    used = worker.counts[USED]
    low = worker.hi[0]
    for k in range(used):
        if pool.status[k] == WAITING or pool.status[k] == UNRESOLVED:
            low = smaller(low, pool.bound[k])
    margin = FIRST_CUT_DISTANCE
    for _ in range(MAX_CUTS):
        cut = low - margin * larger(abs(low), margin)
        if not (cut >= question.lo[0] and cut < np.inf):
            break
        count = 0
        for k in range(used):
            if pool.status[k] == WAITING or pool.status[k] == UNRESOLVED:
                pool.status[k] = WAITING
                pool.key[k] = 0.0
                worker.heap[count] = k
                count += 1
        worker.counts[HEAP] = count
        worker.hi[0] = smaller(cut, worker.hi[0])
        if run(question, worker, pool, kept, node, work, room, gap, gap_absolute, used, True) == ROOM:
            break
        unresolved = 0
        for k in range(used):
            unresolved += pool.status[k] == UNRESOLVED
        if unresolved == 0:
            return True
        margin *= CUT_GROWTH
    return False


@inner
def move_inside(question, worker, room, rows, i, inside):
    """A solution a little inside the largest, as in a search by itself, where there is one: into the row's `z`."""
    value = rows.best[i]
    end = rows.lo[i, 0]
    rows.at_end[i] = end > -np.inf and value <= end + RANGE_END_TOLERANCE * abs(end)
    if rows.at_end[i]:
        return
    question.lo[0] = value * (1.0 + (inside if value > 0.0 else -inside))
    for j in range(room.start.shape[0]):
        room.start[j] = rows.z[i, j]
    hold = question.objective == SCALAR
    if refine(question, worker.hi, room, NEGLIGIBLE_MOTION, hold):
        rows.best[i] = question.lo[0]
        for j in range(room.start.shape[0]):
            rows.z[i, j] = room.z[j]
