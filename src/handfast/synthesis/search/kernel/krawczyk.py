"""Existence, proved, compiled: the Krawczyk test about a candidate, in balls.

As many coordinates as there are equations are taken as dependent, the others stay at their floats. With Y
near the inverse of the dependent part of J, the derivatives, and X the box of radius rho about x,

    |Y F(x)| + |1 - Y J(X)| rho < rho      proves one solution in the interior of X

(Krawczyk 1969, Moore 1977). Over X the inequalities must be positive and the bounds kept, strictly.
"""

from __future__ import annotations

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.balls import BALL_INFLATION
from handfast.synthesis.search.kernel.contact_equations import evaluate
from handfast.synthesis.search.workspace import AXIS_INEQUALITIES
from handfast.synthesis.task_groups import QUATERNION

RADIUS = 1e-7  # rad and units to begin with; the residual asks for more where the system is ill conditioned
RADII = 4  # tenfold larger boxes that are tried
NEAR, STEPS = 1e-12, 2  # rad and units: so near a candidate is told, after so many steps more
TERM_ROUNDING = 1e-14  # a term: more than the rounding of the sums below, relative


@inner
def certify(x, task, bounds, work, chosen, radii):
    """True if an exact solution is proved within `radii` of x (n, 2), between the bounds; work: `LocalWork`.

    Out: chosen (e,) dependent coordinates, radii (e,) of their box; x, nearer to the solution than it was.
    """
    here, there, proof = work.here, work.there, work.proof
    e, quaternion = here.equation.shape[0], task.coordinates.parameter[0] - QUATERNION
    for i in range(x.shape[0]):
        x[i, 1] = 0.0
    evaluate(x, task, here, work.contact)
    if not _dependents(x, quaternion, bounds, here.equation_slope, proof, chosen):
        return False
    for d in range(e):
        for i in range(e):
            proof.matrix[i, d] = here.equation_slope[i, chosen[d], 0]
    if not _invert(proof.matrix, proof.inverse):
        return False
    if not _newton(here.equation, proof):
        return False
    for _ in range(STEPS):  # what is told is that of the solution: so near
        if not _aside(proof):
            break
        for i in range(e):
            for c in range(e):
                x[chosen[i], 0] -= proof.inverse[i, c] * here.equation[c, 0]
        evaluate(x, task, here, work.contact)
        if not _newton(here.equation, proof):
            return False
    radius = RADIUS
    for _ in range(RADII):
        for i in range(x.shape[0]):
            proof.box[i, 0], proof.box[i, 1] = x[i, 0], 0.0
        for d in range(e):
            radii[d] = radius + 2 * proof.moved[d]
            proof.box[chosen[d], 1] = radii[d]
        evaluate(proof.box, task, there, work.contact)
        if _within(proof.box, quaternion, bounds, task.coordinates.axes, there.inequality) and _contracts(
            there.equation_slope, proof, chosen, radii
        ):
            return True
        radius *= 10
    return False


@inner
def _dependents(x, quaternion, bounds, slope, proof, chosen):
    """Choose the dependent coordinates by QR with column pivoting; columns count by their slack.

    slope (e, n, 2): derivatives; chosen (e,): out. Returns false if the columns do not suffice. The largest component
    of the quaternion stays frozen, it is a scale.
    """
    columns, free = proof.columns, proof.free
    e, n = columns.shape
    largest = quaternion
    for i in range(quaternion, quaternion + QUATERNION):
        if abs(x[i, 0]) > abs(x[largest, 0]):
            largest = i
    for c in range(n):
        slack = min(x[c, 0] - bounds.lower[c], bounds.upper[c] - x[c, 0], 1.0)
        free[c] = slack > 0 and c != largest
        for i in range(e):
            columns[i, c] = slope[i, c, 0] * slack
    most = 0.0
    for d in range(e):
        best, size = -1, 0.0
        for c in range(n):
            if free[c]:
                square = 0.0
                for i in range(e):
                    square += columns[i, c] * columns[i, c]
                if square > size:
                    best, size = c, square
        if best < 0 or size <= 1e-18 * most:
            return False
        most = max(most, size)
        chosen[d] = best
        free[best] = 0
        for c in range(n):
            if free[c]:
                along = 0.0
                for i in range(e):
                    along += columns[i, best] * columns[i, c]
                along /= size
                for i in range(e):
                    columns[i, c] -= along * columns[i, best]
    return True


@inner
def _invert(matrix, inverse):
    """The inverse (e, e) by Gauss-Jordan elimination with row pivoting; false if there is none. Overwrites the matrix.

    It need not be accurate: any matrix near the inverse serves the proof.
    """
    e = matrix.shape[0]
    for i in range(e):
        for j in range(e):
            inverse[i, j] = 1.0 if i == j else 0.0
    for c in range(e):
        pivot = c
        for i in range(c + 1, e):
            if abs(matrix[i, c]) > abs(matrix[pivot, c]):
                pivot = i
        if not abs(matrix[pivot, c]) > 0:
            return False
        for j in range(e):
            matrix[c, j], matrix[pivot, j] = matrix[pivot, j], matrix[c, j]
            inverse[c, j], inverse[pivot, j] = inverse[pivot, j], inverse[c, j]
        f = 1.0 / matrix[c, c]
        for j in range(e):
            matrix[c, j] *= f
            inverse[c, j] *= f
        for i in range(e):
            if i != c:
                f = matrix[i, c]
                for j in range(e):
                    matrix[i, j] -= f * matrix[c, j]
                    inverse[i, j] -= f * inverse[c, j]
    return True


@inner
def _newton(equation, proof):
    """Bounds of |Y F(x)|; false if they are too large to be of use."""
    inverse, e = proof.inverse, proof.inverse.shape[0]
    rounded = TERM_ROUNDING * e
    for i in range(e):
        total = 0.0
        value, size = 0.0, 0.0
        for c in range(e):
            value += inverse[i, c] * equation[c, 0]
            size += abs(inverse[i, c] * equation[c, 0])
            total += abs(inverse[i, c]) * equation[c, 1]
        proof.moved[i] = (abs(value) + total + rounded * size) * (1 + rounded)
        if not proof.moved[i] < 1e-2:
            return False
    return True


@inner
def _aside(proof):
    """May a coordinate be farther than `NEAR` from the solution, and none much more?"""
    largest = 0.0
    for i in range(proof.moved.shape[0]):
        largest = max(largest, proof.moved[i])
    return NEAR < largest < RADIUS


@inner
def _within(box, quaternion, bounds, axes, values):
    """Does the whole box (n, 2) keep every bound and every inequality, strictly?

    axes (9, 2): bounds of the object's axes; values (g, 2): of the inequalities.
    """
    b = values.shape[0] - AXIS_INEQUALITIES
    for c in range(box.shape[0]):
        bounded = c < quaternion or c >= quaternion + QUATERNION
        least, most = box[c, 0] - box[c, 1] * BALL_INFLATION, box[c, 0] + box[c, 1] * BALL_INFLATION
        if bounded and not (least > bounds.lower[c] and most < bounds.upper[c]):
            return False
    for i in range(values.shape[0]):
        # the bounds [-1, 1] of an axis are none
        a = i - b
        if a >= 0 and axes[a // 2, a % 2] == (-1.0 if a % 2 == 0 else 1.0):
            continue
        if not values[i, 0] - values[i, 1] * BALL_INFLATION > 0:
            return False
    return True


@inner
def _contracts(slope, proof, chosen, radii):
    """|Y F(x)| + |1 - Y J(X)| rho < rho?"""
    inverse, moved = proof.inverse, proof.moved
    e = inverse.shape[0]
    rounded = TERM_ROUNDING * e
    for i in range(e):
        reach = moved[i]
        for d in range(e):
            value = 1.0 if i == d else 0.0
            size, total = value, 0.0
            for c in range(e):
                term = inverse[i, c] * slope[c, chosen[d], 0]
                value -= term
                size += abs(term)
                total += abs(inverse[i, c]) * slope[c, chosen[d], 1]
            reach += (abs(value) + total + rounded * size) * radii[d]
        if not reach * (1 + rounded) < radii[i]:
            return False
    return True


@inner
def kept(task, work, out, row):
    """Certify the middles of `work.step.x`; what is proved stands in that row of `out`, a `Found`. False if not."""
    x = work.step.x
    proved = certify(x, task, task.coordinates, work, out.chosen[row], out.radii[row])
    if proved:
        for i in range(x.shape[0]):
            out.x[row, i] = x[i, 0]
    return proved
