"""Certified configurations, each of both ways one compiled call.

From random numbers: starts, moved to solutions and proved. From solutions: out along a tangent, back onto the set,
proved anew.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.contact_equations import evaluate
from handfast.synthesis.search.kernel.krawczyk import kept
from handfast.synthesis.search.kernel.levenberg_marquardt import back, factor, solve
from handfast.synthesis.search.kernel.random_start import start
from handfast.synthesis.search.workspace import PROVED, UNPROVED, USED, Interior, LocalWork
from handfast.synthesis.task_groups import QUATERNION, Flat

DAMPING = 1e-12  # of the projection, so that a singular matrix of derivatives does not stop a walk


@inner
def find(chains, regions, coordinates, draws, here, there, contact, step, proof, place, out, many):
    """Solve and certify from each start until `many` are proved, which go to `out`, a `Found`."""
    task, work = Flat(chains, regions, coordinates), LocalWork(here, there, contact, step, proof, place)
    interior, proved, used, unproved = Interior(draws.lower, draws.upper), 0, 0, 0
    while used < draws.numbers.shape[0] and proved < many:
        start(draws.numbers[used], task, interior, step.x, contact, place)
        used += 1
        if not solve(task, interior, work):
            continue
        if kept(task, work, out, proved):
            proved += 1
        else:
            unproved += 1
    out.counts[PROVED], out.counts[USED], out.counts[UNPROVED] = proved, used, unproved
    return 0


@inner
def walk(chains, regions, coordinates, departures, here, there, contact, step, proof, place, out):
    """One step from each of the solutions of `departures`; what is proved at their ends goes to `out`, a `Found`."""
    task, work = Flat(chains, regions, coordinates), LocalWork(here, there, contact, step, proof, place)
    x, interior = step.x, Interior(departures.lower, departures.upper)
    proved, unproved, many = 0, 0, departures.begin.shape[0]
    for s in range(many):
        for c in range(x.shape[0]):
            x[c, 0], x[c, 1] = departures.begin[s, c], 0.0
        evaluate(x, task, here, contact)
        if not _depart(departures, s, coordinates.parameter[0] - QUATERNION, here.equation_slope, step):
            continue
        if not solve(task, interior, work):
            continue
        if kept(task, work, out, proved):
            proved += 1
        else:
            unproved += 1
    out.counts[PROVED], out.counts[USED], out.counts[UNPROVED] = proved, many, unproved
    return 0


@inner
def _depart(departures, s, quaternion, slope, step):
    """Move `step.x` along a tangent, step s; false if its direction has none.

    quaternion: its first coordinate; slope (e, n, 2): derivatives of the equations.
    """
    x, rows, along, normal, z = step.x, step.rows, step.step, step.normal, step.multiplier
    lower, upper, weight, direction = departures.lower, departures.upper, departures.weight, departures.direction[s]
    e, n = slope.shape[0], x.shape[0]
    # the tangents of the set, in weighted coordinates, without the mere scaling of the quaternion
    for c in range(n):
        fixed = not lower[c] < upper[c]
        for i in range(e):
            rows[i, c] = 0.0 if fixed else slope[i, c, 0] / weight[c]
        rows[e, c] = x[c, 0] / weight[c] if quaternion <= c < quaternion + QUATERNION else 0.0
        along[c] = 0.0 if fixed else direction[c]
    for i in range(e + 1):
        for j in range(i + 1):
            normal[i, j] = 0.0
            for c in range(n):
                normal[i, j] += rows[i, c] * rows[j, c]
        normal[i, i] += DAMPING
        z[i] = 0.0
        for c in range(n):
            z[i] += rows[i, c] * along[c]
    if not factor(normal, e + 1):
        return False
    back(normal, e + 1, z)
    size = 0.0
    for c in range(n):
        for i in range(e + 1):
            along[c] -= rows[i, c] * z[i]
        size += along[c] * along[c]
    size = np.sqrt(size)
    if not size > 1e-9:
        return False
    for c in range(n):
        moved = x[c, 0] + departures.length[s] / size * along[c] / weight[c]
        x[c, 0] = min(max(moved, lower[c]), upper[c])
    return True
