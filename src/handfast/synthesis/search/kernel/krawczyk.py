"""Existence, proved, compiled: the Krawczyk test about a candidate, in balls.

As many coordinates as there are equations are taken as dependent, the others stay at their floats. With Y
near the inverse of the dependent part of J and X the box of radius rho about x,

    |Y F(x)| + |1 - Y J(X)| rho < rho      proves one solution in the interior of X

(Krawczyk 1969, Moore 1977). Over X the inequalities must be positive and the bounds kept, strictly.
"""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.balls import UP
from handfast.synthesis.search.kernel.compiled import inner
from handfast.synthesis.search.kernel.contact_equations import evaluate

RADIUS = 1e-7  # rad and units to begin with; the residual asks for more where the system is ill conditioned
RADII = 4  # tenfold larger boxes that are tried


@inner
def dependents(J, x, lower, upper, quaternion, chosen):  # type: ignore[no-untyped-def]
    """Choose the dependent coordinates by QR with column pivoting; columns count by their slack.

    chosen: (e,) out. Returns false if the columns do not suffice. The largest component of the quaternion
    stays frozen, it is a scale.
    """
    e, n = chosen.shape[0], x.shape[0]
    A = np.zeros((e, n))
    free = np.ones(n, dtype=np.bool_)
    largest = quaternion
    for i in range(quaternion, quaternion + 4):
        if abs(x[i, 0]) > abs(x[largest, 0]):
            largest = i
    free[largest] = False
    for c in range(n):
        slack = min(x[c, 0] - lower[c], upper[c] - x[c, 0], 1.0)
        if not slack > 0:
            free[c] = False
            continue
        for i in range(e):
            A[i, c] = J[i, c, 0] * slack
    first = 0.0
    for d in range(e):
        best, size = -1, 0.0
        for c in range(n):
            if free[c]:
                square = 0.0
                for i in range(e):
                    square += A[i, c] * A[i, c]
                if square > size:
                    best, size = c, square
        if best < 0 or size <= 1e-18 * first:
            return False
        first = max(first, size)
        chosen[d] = best
        free[best] = False
        for c in range(n):
            if free[c]:
                along = 0.0
                for i in range(e):
                    along += A[i, best] * A[i, c]
                along /= size
                for i in range(e):
                    A[i, c] -= along * A[i, best]
    return True


@inner
def certify(x, flat, lower, upper, W, chosen, radii):  # type: ignore[no-untyped-def]
    """True if an exact solution is proved within `radii` of x (n, 2) whose radii are zero.

    Out: chosen (e,) dependent coordinates, radii (e,) of their box.
    """
    F, J, G, H, F2, J2, G2, H2 = W
    e = J.shape[0]
    quaternion = flat.params[0] - 4
    x[:, 1] = 0.0
    evaluate(x, flat, F, J, G, H)
    if not dependents(J, x, lower, upper, quaternion, chosen):
        return False
    A = np.empty((e, e))
    for d in range(e):
        for i in range(e):
            A[i, d] = J[i, chosen[d], 0]
    Y = np.zeros((e, e))
    if not invert(A, Y):
        return False
    small = 1e-14 * e  # more than the rounding of the sums below, relative
    moved = np.empty(e)
    for i in range(e):
        total = 0.0
        value, size = 0.0, 0.0
        for c in range(e):
            value += Y[i, c] * F[c, 0]
            size += abs(Y[i, c] * F[c, 0])
            total += abs(Y[i, c]) * F[c, 1]
        moved[i] = (abs(value) + total + small * size) * (1 + small)
        if not moved[i] < 1e-2:
            return False
    rho = RADIUS
    for _ in range(RADII):
        y = x.copy()
        for d in range(e):
            radii[d] = rho + 2 * moved[d]
            y[chosen[d], 1] = radii[d]
        if _contracts(y, flat, lower, upper, Y, moved, chosen, radii, small, F2, J2, G2, H2):
            return True
        rho *= 10
    return False


@inner
def invert(A, Y):  # type: ignore[no-untyped-def]
    """The inverse of A (e, e) into Y, which is zero, by Gauss-Jordan elimination with row pivoting; false if singular.

    A is overwritten.
    """
    e = A.shape[0]
    for i in range(e):
        Y[i, i] = 1.0
    for c in range(e):
        pivot = c
        for i in range(c + 1, e):
            if abs(A[i, c]) > abs(A[pivot, c]):
                pivot = i
        if not abs(A[pivot, c]) > 0:
            return False
        for j in range(e):
            A[c, j], A[pivot, j] = A[pivot, j], A[c, j]
            Y[c, j], Y[pivot, j] = Y[pivot, j], Y[c, j]
        f = 1.0 / A[c, c]
        for j in range(e):
            A[c, j] *= f
            Y[c, j] *= f
        for i in range(e):
            if i != c:
                g = A[i, c]
                for j in range(e):
                    A[i, j] -= g * A[c, j]
                    Y[i, j] -= g * Y[c, j]
    return True


@inner
def _contracts(y, flat, lower, upper, Y, moved, chosen, radii, small, F, J, G, H):  # type: ignore[no-untyped-def]
    e, n = Y.shape[0], y.shape[0]
    quaternion = flat.params[0] - 4
    for c in range(n):
        bounded = c < quaternion or c >= quaternion + 4
        if bounded and not (y[c, 0] - y[c, 1] * UP > lower[c] and y[c, 0] + y[c, 1] * UP < upper[c]):
            return False
    evaluate(y, flat, F, J, G, H)
    for i in range(G.shape[0]):
        # the bounds [-1, 1] of an axis are none
        a = i - flat.steps.shape[0]
        if a >= 0 and flat.axes[a // 2, a % 2] == (-1.0 if a % 2 == 0 else 1.0):
            continue
        if not G[i, 0] - G[i, 1] * UP > 0:
            return False
    for i in range(e):
        reach = moved[i]
        for d in range(e):
            value = 1.0 if i == d else 0.0
            size, total = value, 0.0
            for c in range(e):
                term = Y[i, c] * J[c, chosen[d], 0]
                value -= term
                size += abs(term)
                total += abs(Y[i, c]) * J[c, chosen[d], 1]
            reach += (abs(value) + total + small * size) * radii[d]
        if not reach * (1 + small) < radii[i]:
            return False
    return True
