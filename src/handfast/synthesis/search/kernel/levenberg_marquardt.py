"""Candidates for solutions, compiled: damped Gauss-Newton within the bounds.

Many starts are cheap and need no guess; what they find is only a candidate until `krawczyk` proves it.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.contact_equations import evaluate
from handfast.synthesis.search.workspace import CANDIDATE_MARGIN
from handfast.synthesis.task_groups import QUATERNION

CANDIDATE_RESIDUAL = 1e-12  # units: largest residual of a candidate
SOLVER_ITERATIONS = 60  # iterations of one solve
HOLDS = 4  # times that a step is worked out anew with more coordinates held at their bounds
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-15, 1e6


@inner
def solve(task, interior, work):
    """Move `step.x` of a `LocalWork` to a candidate; true if it is one.

    Levenberg-Marquardt in the space of the rows, which are fewer than the coordinates; a coordinate at a
    bound that the step would cross is held for that step.
    """
    here, there, contact, step = work.here, work.there, work.contact, work.step
    x, trial = step.x, step.trial
    for i in range(x.shape[0]):
        trial[i, 0], trial[i, 1] = x[i, 0], x[i, 1]
    evaluate(x, task, here, contact)
    size = _squares(here)
    damping = FIRST_DAMPING
    for _ in range(SOLVER_ITERATIONS):
        if _solved(here):
            return True
        m = _rows(here, step)
        _step(m, damping, interior, step)
        _move(task.coordinates.parameter[0] - QUATERNION, interior, step)
        evaluate(trial, task, there, contact)
        new = _squares(there)
        if new < size:
            for i in range(x.shape[0]):
                x[i, 0] = trial[i, 0]
            _copy(there, here)
            # quickly down when it goes well, so that the end is quadratic
            damping = max(damping * (0.1 if new < 0.25 * size else 0.5), LEAST_DAMPING)
            size = new
        else:
            damping *= 8.0
            if damping > MOST_DAMPING:
                return False
    return False


@inner
def _squares(values):
    """Sum of squares of equations and of inequalities short of their margin."""
    total = 0.0
    for i in range(values.equation.shape[0]):
        total += values.equation[i, 0] * values.equation[i, 0]
    for i in range(values.inequality.shape[0]):
        short = CANDIDATE_MARGIN - values.inequality[i, 0]
        if short > 0:
            total += short * short
    return total


@inner
def _solved(values):
    largest = 0.0
    for i in range(values.equation.shape[0]):
        largest = max(largest, abs(values.equation[i, 0]))
    inside = True
    for i in range(values.inequality.shape[0]):
        inside &= values.inequality[i, 0] >= 0.5 * CANDIDATE_MARGIN
    return inside and largest <= CANDIDATE_RESIDUAL


@inner
def _copy(values, out):
    """Middles and derivatives."""
    n = values.equation_slope.shape[1]
    for i in range(values.equation.shape[0]):
        out.equation[i, 0] = values.equation[i, 0]
        for c in range(n):
            out.equation_slope[i, c, 0] = values.equation_slope[i, c, 0]
    for i in range(values.inequality.shape[0]):
        out.inequality[i, 0] = values.inequality[i, 0]
        for c in range(n):
            out.inequality_slope[i, c, 0] = values.inequality_slope[i, c, 0]


@inner
def _rows(values, step):
    """The equations, and the inequalities that are short of their margin, as rows of a step; how many these are."""
    n, m = values.equation_slope.shape[1], values.equation.shape[0]
    for i in range(m):
        step.wanted[i] = -values.equation[i, 0]
        for c in range(n):
            step.rows[i, c] = values.equation_slope[i, c, 0]
    for i in range(values.inequality.shape[0]):
        if values.inequality[i, 0] < CANDIDATE_MARGIN:
            step.wanted[m] = CANDIDATE_MARGIN - values.inequality[i, 0]
            for c in range(n):
                step.rows[m, c] = values.inequality_slope[i, c, 0]
            m += 1
    return m


@inner
def _step(m, damping, interior, s):
    """The damped step of the first m rows, and which coordinates it holds."""
    x, lower, upper = s.x, interior.lower, interior.upper
    n = x.shape[0]
    for c in range(n):
        s.step[c], s.held[c] = 0.0, lower[c] == upper[c]
    for _ in range(HOLDS):
        for i in range(m):
            for j in range(i + 1):
                total = 0.0
                for c in range(n):
                    if not s.held[c]:
                        total += s.rows[i, c] * s.rows[j, c]
                s.normal[i, j] = total
            s.normal[i, i] += damping
        if not factor(s.normal, m):
            break
        for i in range(m):
            s.multiplier[i] = s.wanted[i]
        back(s.normal, m, s.multiplier)
        again = False
        for c in range(n):
            s.step[c] = 0.0
            if s.held[c]:
                continue
            for i in range(m):
                s.step[c] += s.rows[i, c] * s.multiplier[i]
            if (x[c, 0] <= lower[c] and s.step[c] < 0) or (x[c, 0] >= upper[c] and s.step[c] > 0):
                s.held[c] = 1
                again = True
        if not again:
            break


@inner
def _move(quaternion, interior, step):
    """Take the step, within the bounds; the quaternion becomes a unit one; quaternion: its first."""
    x, trial = step.x, step.trial
    for c in range(x.shape[0]):
        move = 0.0 if step.held[c] else min(max(step.step[c], -1.0), 1.0)
        trial[c, 0] = min(max(x[c, 0] + move, interior.lower[c]), interior.upper[c])
    length = 0.0
    for i in range(QUATERNION):
        length += trial[quaternion + i, 0] * trial[quaternion + i, 0]
    length = np.sqrt(length)
    for i in range(QUATERNION):
        trial[quaternion + i, 0] /= length


@inner
def factor(matrix, m):
    """Cholesky factor of a symmetric matrix's first m rows in place; false if it is not positive definite."""
    for i in range(m):
        for j in range(i + 1):
            total = matrix[i, j]
            for c in range(j):
                total -= matrix[i, c] * matrix[j, c]
            if i == j:
                if not total > 0:
                    return False
                matrix[i, i] = np.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    return True


@inner
def back(lower, m, z):
    """Solve L L^T z = z in place."""
    for i in range(m):
        for c in range(i):
            z[i] -= lower[i, c] * z[c]
        z[i] /= lower[i, i]
    for i in range(m - 1, -1, -1):
        for c in range(i + 1, m):
            z[i] -= lower[c, i] * z[c]
        z[i] /= lower[i, i]
