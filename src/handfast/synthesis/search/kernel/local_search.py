"""From random numbers to certified configurations: one compiled call."""

from __future__ import annotations

import numpy as np

from handfast.synthesis.search.kernel.compiled import kernel
from handfast.synthesis.search.kernel.krawczyk import certify
from handfast.synthesis.search.kernel.levenberg_marquardt import MARGIN, solve, start, workspace


@kernel
def find(numbers, flat, e, many, xs, chosen, radii, which):  # type: ignore[no-untyped-def]
    """Solve and certify from each start until `many` are proved.

    numbers: (starts, .) uniform random numbers for `start`. Out, a row for each: xs (many, n) coordinates,
    chosen (many, e), radii (many, e), which (many,) start. Returns (number proved, starts used, candidates
    that could not be proved).
    """
    n = flat.lower.shape[0]
    x = np.zeros((n, 2))
    W = workspace(flat, e, n)
    lower, upper = inside(flat)
    proved, open_ones = 0, 0
    for s in range(numbers.shape[0]):
        start(numbers[s], flat, lower, upper, x)
        if not solve(x, flat, lower, upper, W):
            continue
        if not certify(x, flat, flat.lower, flat.upper, W, chosen[proved], radii[proved]):
            open_ones += 1
            continue
        xs[proved] = x[:, 0]
        which[proved] = s
        proved += 1
        if proved == many:
            return proved, s + 1, open_ones
    return proved, numbers.shape[0], open_ones


@kernel
def inside(flat):  # type: ignore[no-untyped-def]
    """The bounds, drawn in by `MARGIN` or by a quarter of what there is."""
    room = np.minimum(MARGIN, 0.25 * (flat.upper - flat.lower))
    return flat.lower + room, flat.upper - room
