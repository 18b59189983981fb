"""Linear complementarity problems by Lemke's method: w = M z + q, w >= 0, z >= 0, w . z = 0.

C. E. Lemke, "Bimatrix Equilibrium Points and Mathematical Programming", Management Science 11(7), 1965; R. W. Cottle,
J.-S. Pang, R. E. Stone, "The Linear Complementarity Problem", 1992, section 4.4. In floating point: the basis is
factored anew at every pivot, and ties are kept apart by a covering vector without equal entries.
"""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array, Indices

SMALL = 1e-11  # relative: pivots below it are none
MISSED = 1e-10  # by how much a variable may be negative at the end, beside q; it is then taken as 0
STARTS = 5  # covering vectors: where rounding ends the path from one, another may lead through


def lemke(M: Array, q: Array, *, pivots: int = 2000, cover: Array | None = None) -> Array | None:
    """A solution z (n,) for M (n, n) and q (n,); None if the method ends on rays, or after so many pivots each time.

    cover: (n,) > 0, the covering vector; where there are several solutions, it decides which one is found.
    """
    if (q >= 0).all():
        return np.zeros(len(q))
    if cover is not None:
        return _from(M, q, cover, pivots)
    for start in range(STARTS):
        cover = 1.0 + np.linspace(0.0, 0.5, len(q)) * np.cos((1.0 + start) * np.arange(len(q)))
        z = _from(M, q, cover, pivots)
        if z is not None:
            return z
    return None


def _from(M: Array, q: Array, cover: Array, pivots: int) -> Array | None:
    """The end of the path that begins with a covering vector (n,) > 0."""
    n = len(q)
    columns = np.hstack([np.eye(n), -M, -cover[:, None]])  # of w, z, and the covering variable z0
    basis = np.arange(n)
    leave = int(np.argmin(q / cover))
    enter = 2 * n
    for _ in range(pivots):
        gone, basis[leave] = int(basis[leave]), enter
        if gone == 2 * n:
            return _solution(columns, basis, q, n)
        enter = gone + n if gone < n else gone - n  # its complement comes in
        B = columns[:, basis]
        try:
            both = np.linalg.solve(B, np.column_stack([q, columns[:, enter]]))
        except np.linalg.LinAlgError:
            return None
        x, step = np.maximum(both[:, 0], 0.0), both[:, 1]
        falls = step > SMALL * np.abs(step).max()
        if not falls.any():
            return None
        ratio = np.where(falls, x / np.where(falls, step, 1.0), np.inf)
        near = np.flatnonzero(ratio <= ratio.min() * (1 + 1e-12) + 1e-300)
        z0 = near[basis[near] == 2 * n]  # ends as soon as it can
        leave = int(z0[0]) if len(z0) else int(near[np.argmax(step[near])])
    return None


def _solution(columns: Array, basis: Indices, q: Array, n: int) -> Array | None:
    """z of the final basis; None if it misses the problem by more than rounding."""
    try:
        x = np.linalg.solve(columns[:, basis], q)
    except np.linalg.LinAlgError:
        return None
    all_of = np.zeros(2 * n + 1)
    all_of[basis] = x
    return np.maximum(all_of[n : 2 * n], 0.0) if x.min() > -MISSED * float(np.abs(q).max()) else None
