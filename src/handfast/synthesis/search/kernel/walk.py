"""Steps along the set of solutions, compiled: out along a tangent, back onto the set, proved anew."""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.compiled import kernel
from handfast.synthesis.search.kernel.contact_equations import evaluate
from handfast.synthesis.search.kernel.krawczyk import certify
from handfast.synthesis.search.kernel.levenberg_marquardt import back, factor, solve, workspace
from handfast.synthesis.search.kernel.local_search import inside

DAMPING = 1e-12  # of the projection, so that a singular Jacobian does not stop a walk


@kernel
def walk(begin, numbers, lengths, weight, flat, e, xs, chosen, radii):  # type: ignore[no-untyped-def]
    """One step from each of the solutions `begin` (m, n).

    numbers: (m, n) standard normal, one direction each; lengths: (m,) of the steps, in the norm of
    weight * x, weight (n,) positive. Out, a row for each that succeeds: xs (m, n), chosen (m, e), radii
    (m, e). Returns (number proved, candidates that could not be proved).
    """
    m, n = begin.shape
    quaternion = flat.params[0] - 4
    W = workspace(flat, e, n)
    F, J, G, H, _, _, _, _ = W
    lower, upper = inside(flat)
    x, d, z = np.zeros((n, 2)), np.empty(n), np.empty(e + 1)
    A, B = np.empty((e + 1, n)), np.empty((e + 1, e + 1))
    proved, open_ones = 0, 0
    for s in range(m):
        x[:, 0] = begin[s]
        x[:, 1] = 0.0
        evaluate(x, flat, F, J, G, H)
        # the tangents of the set, in weighted coordinates, without the mere scaling of the quaternion
        for c in range(n):
            fixed = not lower[c] < upper[c]
            for i in range(e):
                A[i, c] = 0.0 if fixed else J[i, c, 0] / weight[c]
            A[e, c] = x[c, 0] / weight[c] if quaternion <= c < quaternion + 4 else 0.0
            d[c] = 0.0 if fixed else numbers[s, c]
        for i in range(e + 1):
            for j in range(i + 1):
                B[i, j] = 0.0
                for c in range(n):
                    B[i, j] += A[i, c] * A[j, c]
            B[i, i] += DAMPING
            z[i] = 0.0
            for c in range(n):
                z[i] += A[i, c] * d[c]
        if not factor(B, e + 1):
            continue
        back(B, e + 1, z)
        for c in range(n):
            for i in range(e + 1):
                d[c] -= A[i, c] * z[i]
        size = 0.0
        for c in range(n):
            size += d[c] * d[c]
        size = np.sqrt(size)
        if not size > 1e-9:
            continue
        for c in range(n):
            moved = x[c, 0] + lengths[s] / size * d[c] / weight[c]
            x[c, 0] = min(max(moved, lower[c]), upper[c])
        if not solve(x, flat, lower, upper, W):
            continue
        if not certify(x, flat, flat.lower, flat.upper, W, chosen[proved], radii[proved]):
            open_ones += 1
            continue
        xs[proved] = x[:, 0]
        proved += 1
    return proved, open_ones
