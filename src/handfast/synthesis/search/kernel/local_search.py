"""From random numbers to certified configurations: one compiled call."""

from __future__ import annotations

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.krawczyk import kept
from handfast.synthesis.search.kernel.levenberg_marquardt import solve
from handfast.synthesis.search.kernel.random_start import start
from handfast.synthesis.search.workspace import PROVED, UNPROVED, USED, Interior


@inner
def find(chains, regions, coordinates, draws, here, there, contact, step, proof, place, out, many):
    """Solve and certify from each start until `many` are proved, which go to `out`, a `Found`."""
    x, interior = step.x, Interior(draws.lower, draws.upper)
    proved, used, unproved = 0, 0, 0
    while used < draws.numbers.shape[0] and proved < many:
        start(draws.numbers[used], chains, regions, coordinates, interior, x, contact, place)
        used += 1
        if not solve(chains, regions, coordinates, interior, here, there, contact, step):
            continue
        if kept(chains, regions, coordinates, here, there, contact, step.x, proof, out, proved):
            proved += 1
        else:
            unproved += 1
    out.counts[PROVED], out.counts[USED], out.counts[UNPROVED] = proved, used, unproved
    return 0
