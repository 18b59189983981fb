"""Local solves, compiled: damped Gauss-Newton from aligned random starts, within the bounds.

Many starts are cheap and need no guess; what they find is only a candidate until `krawczyk` proves it.
"""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.balls import get
from handfast.synthesis.search.kernel.compiled import inner
from handfast.synthesis.search.kernel.contact_equations import PATCH, chain, evaluate, rotation, surface

MARGIN = 1e-4  # candidates keep this far inside every bound, so that strictness costs nothing
SOLVED = 1e-12  # units: largest residual of a candidate
ROUNDS = 60  # iterations of one solve
ALIGNED = 8  # random poses of which a start takes the one that violates the pose bounds least
NUMBERS = 8  # random numbers that place the object once


@inner
def start(numbers, flat, lower, upper, x):  # type: ignore[no-untyped-def]
    """A random start into x (n, 2): one contact placed exactly, with a random spin.

    numbers: (n + 1 + ALIGNED * NUMBERS,) uniform in [0, 1).
    """
    n, b = x.shape[0], flat.steps.shape[0]
    joints = flat.params[0] - 7
    x[:, 1] = 0.0
    for i in range(n):
        x[i, 0] = lower[i] + numbers[i] * (upper[i] - lower[i])
    for i in range(4):
        x[joints + 3 + i, 0] = 1.0 if i == 0 else 0.0
    k = min(int(numbers[n] * b), b - 1)
    most = flat.var.shape[1]
    R, p = np.empty((3, 3, 2)), np.empty((3, 2))
    axes, spots = np.empty((most + 1, 3, 2)), np.empty((most + 1, 3, 2))
    chain(k, x, flat, R, p, axes, spots)
    o, h = np.empty((6, 3, 2)), np.empty((6, 3, 2))
    normal, m = np.empty((3, 2)), np.empty((3, 2))
    ns, nt = np.empty((3, 2)), np.empty((3, 2))
    first = flat.params[k]
    surface(k, k, get(x, first), get(x, first + 1), flat, o, normal, ns, nt)
    inward, spot = np.empty(3), np.empty(3)
    best, kept = np.inf, np.zeros(7)
    M = np.empty((3, 3))
    Q = np.empty((5, 3, 3, 2))
    for attempt in range(ALIGNED):
        at = n + 1 + attempt * NUMBERS
        if flat.hand[k] == PATCH:
            surface(b + k, k, get(x, first + 2), get(x, first + 3), flat, h, m, ns, nt)
            for i in range(3):
                inward[i] = m[i, 0]
                spot[i] = h[0, i, 0]
        else:
            # a random direction within the cone of the cap
            edge = max(flat.cone[k], -1.0)
            c = edge + (1 - edge) * numbers[at]
            s = np.sqrt(max(0.0, 1 - c * c))
            frame(flat.axis[k], 2 * np.pi * numbers[at + 1], M)
            for i in range(3):
                inward[i] = flat.sign[k] * (c * flat.axis[k, i] + s * M[i, 0])
                spot[i] = flat.center[k, i]
        # turn the object so that its normal opposes the hand's, with a random spin about it
        target = np.zeros(3)
        for i in range(3):
            for j in range(3):
                target[i] -= R[i, j, 0] * inward[j]
        frame(target, 2 * np.pi * numbers[at + 2], M)
        own = np.empty((3, 3))
        frame(normal[:, 0].copy(), 0.0, own)
        turning = np.zeros((3, 3))
        for i in range(3):
            for j in range(3):
                for l in range(3):
                    turning[i, j] += M[i, l] * own[j, l]
        quaternion(turning, x, joints + 3)
        rotation(x, joints + 3, Q)
        for i in range(3):
            value = p[i, 0]
            for j in range(3):
                y = o[0, j, 0]
                if flat.hand[k] != PATCH:
                    y += flat.radius[k] * normal[j, 0]
                value += R[i, j, 0] * spot[j] - Q[0, i, j, 0] * y
            x[joints + i, 0] = min(max(value, lower[joints + i]), upper[joints + i])
        fault = 0.0
        for l in range(3):
            for i in range(3):
                value = Q[0, i, l, 0]
                fault += max(0.0, flat.axes[3 * l + i, 0] - value) + max(0.0, value - flat.axes[3 * l + i, 1])
        if fault < best:
            best = fault
            kept[:] = x[joints : joints + 7, 0]
        if best == 0.0:
            break
    x[joints : joints + 7, 0] = kept


@inner
def frame(z, spin, out):  # type: ignore[no-untyped-def]
    """A rotation (3, 3) whose third column is the unit vector z, turned about it."""
    l = 0
    for i in range(3):
        if abs(z[i]) < abs(z[l]):
            l = i
    e = np.zeros(3)
    e[l] = 1.0
    e1 = np.cross(e, z)
    e1 /= np.sqrt(e1[0] * e1[0] + e1[1] * e1[1] + e1[2] * e1[2])
    e2 = np.cross(z, e1)
    c, s = np.cos(spin), np.sin(spin)
    for i in range(3):
        out[i, 0] = c * e1[i] + s * e2[i]
        out[i, 1] = c * e2[i] - s * e1[i]
        out[i, 2] = z[i]


@inner
def quaternion(R, x, first):  # type: ignore[no-untyped-def]
    """Unit quaternion of a rotation (3, 3) into x[first:first+4]."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    l = 0
    for i in range(1, 3):
        if R[i, i] > R[l, l]:
            l = i
    if trace > 0:
        w = 0.5 * np.sqrt(1 + trace)
        x[first, 0] = w
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            x[first + 1 + i, 0] = (R[k, j] - R[j, k]) / (4 * w)
        return
    j, k = (l + 1) % 3, (l + 2) % 3
    v = 0.5 * np.sqrt(max(1e-300, 1 + R[l, l] - R[j, j] - R[k, k]))
    x[first, 0] = (R[k, j] - R[j, k]) / (4 * v)
    x[first + 1 + l, 0] = v
    x[first + 1 + j, 0] = (R[l, j] + R[j, l]) / (4 * v)
    x[first + 1 + k, 0] = (R[l, k] + R[k, l]) / (4 * v)


@inner
def residual(F, G, e):  # type: ignore[no-untyped-def]
    """Sum of squares of equations and of inequalities short of their margin."""
    total = 0.0
    for i in range(e):
        total += F[i, 0] * F[i, 0]
    for i in range(G.shape[0]):
        short = MARGIN - G[i, 0]
        if short > 0:
            total += short * short
    return total


@inner
def solve(x, flat, lower, upper, W):  # type: ignore[no-untyped-def]
    """Move x (n, 2) to a candidate; true if it is one.

    Levenberg-Marquardt in the space of the rows, which are fewer than the coordinates; a coordinate at a
    bound that the step would cross is held for that step. W: workspace from `workspace`.
    """
    F, J, G, H, F2, J2, G2, H2 = W
    e, n = J.shape[0], x.shape[0]
    joints = flat.params[0] - 7
    evaluate(x, flat, F, J, G, H)
    size = residual(F, G, e)
    damping = 1e-2
    y = x.copy()
    held = np.zeros(n, dtype=np.bool_)
    step = np.empty(n)
    most = e + G.shape[0]
    rows, values = np.empty((most, n)), np.empty(most)
    for _ in range(ROUNDS):
        largest = 0.0
        for i in range(e):
            largest = max(largest, abs(F[i, 0]))
        inside = True
        for i in range(G.shape[0]):
            inside &= G[i, 0] >= 0.5 * MARGIN
        if largest <= SOLVED and inside:
            return True
        m = e
        for i in range(e):
            rows[i] = J[i, :, 0]
            values[i] = -F[i, 0]
        for i in range(G.shape[0]):
            if G[i, 0] < MARGIN:
                rows[m] = H[i, :, 0]
                values[m] = MARGIN - G[i, 0]
                m += 1
        held[:] = False
        for i in range(n):
            if lower[i] == upper[i]:
                held[i] = True
        for _ in range(4):
            A = np.zeros((m, m))
            for i in range(m):
                for j in range(i + 1):
                    total = 0.0
                    for c in range(n):
                        if not held[c]:
                            total += rows[i, c] * rows[j, c]
                    A[i, j] = total
                A[i, i] += damping
            if not factor(A, m):
                break
            z = values[:m].copy()
            back(A, m, z)
            again = False
            for c in range(n):
                step[c] = 0.0
                if held[c]:
                    continue
                for i in range(m):
                    step[c] += rows[i, c] * z[i]
                if (x[c, 0] <= lower[c] and step[c] < 0) or (x[c, 0] >= upper[c] and step[c] > 0):
                    held[c] = True
                    again = True
            if not again:
                break
        for c in range(n):
            move = 0.0 if held[c] else min(max(step[c], -1.0), 1.0)
            y[c, 0] = min(max(x[c, 0] + move, lower[c]), upper[c])
        length = 0.0
        for i in range(4):
            length += y[joints + 3 + i, 0] ** 2
        length = np.sqrt(length)
        for i in range(4):
            y[joints + 3 + i, 0] /= length
        evaluate(y, flat, F2, J2, G2, H2)
        new = residual(F2, G2, e)
        if new < size:
            x[:, 0] = y[:, 0]
            F[:] = F2
            J[:] = J2
            G[:] = G2
            H[:] = H2
            # quickly down when it goes well, so that the end is quadratic
            damping = max(damping * (0.1 if new < 0.25 * size else 0.5), 1e-15)
            size = new
        else:
            damping *= 8.0
            if damping > 1e6:
                return False
    return False


@inner
def factor(A, m):  # type: ignore[no-untyped-def]
    """Cholesky factor of a symmetric matrix in place; false if it is not positive definite."""
    for i in range(m):
        for j in range(i + 1):
            total = A[i, j]
            for c in range(j):
                total -= A[i, c] * A[j, c]
            if i == j:
                if not total > 0:
                    return False
                A[i, i] = np.sqrt(total)
            else:
                A[i, j] = total / A[j, j]
    return True


@inner
def back(L, m, z):  # type: ignore[no-untyped-def]
    """Solve L L^T z = z in place."""
    for i in range(m):
        for c in range(i):
            z[i] -= L[i, c] * z[c]
        z[i] /= L[i, i]
    for i in range(m - 1, -1, -1):
        for c in range(i + 1, m):
            z[i] -= L[c, i] * z[c]
        z[i] /= L[i, i]


@inner
def workspace(flat, e, n):  # type: ignore[no-untyped-def]
    """Arrays of `evaluate`, twice."""
    g = flat.steps.shape[0] + 18
    F, G = np.zeros((e, 2)), np.zeros((g, 2))
    J, H = np.zeros((e, n, 2)), np.zeros((g, n, 2))
    return F, J, G, H, F.copy(), J.copy(), G.copy(), H.copy()
