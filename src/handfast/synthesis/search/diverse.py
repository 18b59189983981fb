"""Many configurations: steps along the set of solutions from those that random starts have found.

A step goes along a random tangent, is brought back onto the set and proved anew. It stays within the component of
the set that it began in, which is why there are random starts too. Neither uniform coverage nor connectedness
of the set is claimed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handfast.core.arrays import Array
from handfast.core.groups import Block, table
from handfast.synthesis.distance import LENGTH
from handfast.synthesis.search.library import LIBRARY
from handfast.synthesis.search.starts import Certified, Starts, taken
from handfast.synthesis.search.workspace import UNPROVED, Departures, found, interior, local_work
from handfast.synthesis.task_problem import TaskProblem

STEP = 1.0  # longest step, in the measure of `distance`
WALKS = 256  # steps of one call
WALK_SEED = 1_000_003  # tells the random numbers of the steps from those of the starts


class Walks:
    """Reproducible steps along the set of solutions from configurations that are known."""

    def __init__(self, starts: Starts) -> None:
        self.starts, self.problem, self.round = starts, starts.problem, 0
        self.weight = _weights(self.problem)

    def run(self, pool: Sequence[Certified]) -> list[Certified]:
        """New certified configurations, each a step from one of the pool, picked at random."""
        n, m = self.problem.n, WALKS if pool else 0
        rng = np.random.default_rng([self.starts.seed, WALK_SEED, self.round])
        begin = np.zeros((m, n))
        for row, k in zip(begin, rng.integers(max(len(pool), 1), size=m), strict=True):
            row[:] = pool[k].x
        self.round += bool(pool)
        return self.steps(begin, rng.standard_normal((m, n)), STEP * rng.random(m))

    def steps(self, begin: Array, directions: Array, lengths: Array) -> list[Certified]:
        """Those steps from configurations `begin` (m, n) that end in certified ones, in order.

        Args:
            directions: (m, n) in coordinates times `weight`; what is tangent of them is gone along.
            lengths: (m,) in the measure of `distance`.
        """
        p = self.problem
        departures = Departures(begin, directions, lengths, self.weight, *interior(p.flat))
        task, work = map(table, p.flat), [Block(x) for x in local_work(p.flat, p.equations)[:-1]]
        block = Block(found(p.n, p.equations, len(begin)))
        LIBRARY.functions.walk(*task, table(departures), *(b.table for b in work), block.table)
        out = block.arrays()
        self.starts.unproved += int(out.counts[UNPROVED])
        return taken(out)


def _weights(problem: TaskProblem) -> Array:
    """(n,) how much a coordinate counts in the length of a step: as in `distance`, a patch's whole side as 1."""
    straight = {f"joint:{j.name}" for j in problem.task.hand.joints if j.type == "prismatic"}
    out = np.ones(problem.n)
    for i, label in enumerate(problem.labels):
        if label in straight or label.startswith("position:"):
            out[i] = problem.unit / LENGTH
        elif label.startswith("quaternion:"):
            out[i] = 2.0  # a unit quaternion turns by half the angle
    return out
