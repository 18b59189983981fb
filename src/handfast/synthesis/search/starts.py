"""Certified configurations: from random starts, and by steps along the set of solutions from those that are known.

Starts come in seeded blocks, each one compiled call. A step goes along a random tangent, is brought back onto the set
and proved anew. It stays within the component of the set that it began in, which is why there are random starts too.
Neither uniform coverage nor connectedness of the set is claimed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.core.groups import Block, table
from handfast.proofs.configurations import ContactPoint, Existence
from handfast.proofs.constants import RADIAN_LENGTH
from handfast.synthesis.search.library import LIBRARY
from handfast.synthesis.search.workspace import (
    PLACEMENT_NUMBERS,
    POSE_TRIES,
    PROVED,
    UNPROVED,
    USED,
    Departures,
    Draws,
    Found,
    found,
    interior,
    local_work,
)
from handfast.synthesis.task_problem import TaskProblem

START_BLOCK = 256  # starts that share one seed: the unit in which a search is resumed
MAX_START_STEP = 1.0  # longest step, in the measure of `distance`
WALKS = 256  # steps of one call
WALK_SEED = 1_000_003  # tells the random numbers of the steps from those of the starts


@dataclass(frozen=True, eq=False)
class Certified:
    """Coordinates that the Krawczyk test has proved to be next to an exact configuration.

    Attributes:
        x: (n,) in units of the problem.
        chosen: (e,) the dependent coordinates; radii: (e,) the half widths of their box.
    """

    x: Array
    chosen: Indices
    radii: Array

    @classmethod
    def of(cls, proof: Existence, problem: TaskProblem) -> Certified:
        """That of a proof of the problem's task: `existence` undone, to the last bit, for units are powers of two."""
        value = proof.coordinates
        x = np.array([value[label] for label in problem.labels]) / problem.lengths
        chosen = np.array([problem.labels.index(label) for label in proof.dependent], dtype=np.intp)
        return cls(x, chosen, proof.radii / problem.lengths[chosen])

    def existence(self, problem: TaskProblem) -> Existence:
        """The proof in SI units, by labels."""
        value = dict(zip(problem.labels, (self.x * problem.lengths).tolist(), strict=True))
        contacts = []
        for k, pair in enumerate(problem.task.contact_pairs):
            s, t, u, v = (value.get(f"contact:{k}:{name}", 0.0) for name in "stuv")
            contacts.append(ContactPoint(pair.link, (s, t), None if pair.hand.ball else (u, v)))
        return Existence(
            joints={name.removeprefix("joint:"): y for name, y in value.items() if name.startswith("joint:")},
            position=np.array([value[f"position:{i}"] for i in range(3)]),
            quaternion=np.array([value[f"quaternion:{i}"] for i in range(4)]),
            contacts=tuple(contacts),
            dependent=tuple(problem.labels[c] for c in self.chosen),
            radii=self.radii * problem.lengths[self.chosen],
        )


class Starts:
    """An endless, reproducible row of local searches.

    Args:
        problem: the task in minimal coordinates.
        seed: block k draws from `default_rng([seed, k])`, so that neither the time nor the number of
            configurations asked for changes what a start finds.
        block: to begin with.
    """

    def __init__(self, problem: TaskProblem, seed: int, block: int = 0) -> None:
        self.problem, self.seed, self.block = problem, seed, block
        self.count = block * START_BLOCK
        self.unproved = 0
        self._interior, self._task = interior(problem.flat), tuple(map(table, problem.flat))
        self._work = tuple(map(Block, local_work(problem.flat, problem.equations)))
        self._block = Block(found(problem.n, problem.equations, START_BLOCK))
        self._kernel = LIBRARY.functions  # compiles where that has not been done yet

    @property
    def _width(self) -> int:
        return self.problem.n + 1 + POSE_TRIES * PLACEMENT_NUMBERS

    def run(self, many: int = START_BLOCK) -> list[Certified]:
        """The certified configurations of the next block, at most `many`; the rest of the block is left out."""
        numbers = np.random.default_rng([self.seed, self.block]).random((START_BLOCK, self._width))
        out: list[Certified] = []
        first = 0
        while first < START_BLOCK and len(out) < many:
            some, used = self._find(numbers[first:], many - len(out))
            out += some
            first += used
        self.block += 1
        self.count += first
        return out

    def near(self, points: Array, many: int = 1) -> list[Certified]:
        """At most `many` certified configurations from starts at joints and region parameters (k, n)."""
        lower, upper = self.problem.flat.coordinates.lower, self.problem.flat.coordinates.upper
        numbers = np.random.default_rng([self.seed, self.block, 1]).random((len(points), self._width))
        width = np.where(upper > lower, upper - lower, 1.0)
        numbers[:, : self.problem.n] = np.clip((points - lower) / width, 0.0, 1.0)
        return self._find(numbers, many)[0]

    def _find(self, numbers: Array, many: int) -> tuple[list[Certified], int]:
        """The first certified configurations from starts of these random numbers, at most `many`; starts used."""
        draws = Draws(numbers, *self._interior)
        self._kernel.find(*self._task, table(draws), *(b.table for b in self._work), self._block.table, many)
        out = self._block.arrays()
        self.unproved += int(out.counts[UNPROVED])
        return taken(out), int(out.counts[USED])


def taken(out: Found) -> list[Certified]:
    """Copies of the configurations that a kernel has found."""
    rows = range(out.counts[PROVED])
    return [Certified(out.x[i].copy(), out.chosen[i].copy(), out.radii[i].copy()) for i in rows]


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
        return self.steps(begin, rng.standard_normal((m, n)), MAX_START_STEP * rng.random(m))

    def steps(self, begin: Array, directions: Array, lengths: Array) -> list[Certified]:
        """Those steps from configurations `begin` (m, n) that end in certified ones, in order.

        Args:
            directions: (m, n) in coordinates times `weight`; what is tangent of them is gone along.
            lengths: (m,) in the measure of `distance`.
        """
        p = self.problem
        departures = Departures(begin, directions, lengths, self.weight, *interior(p.flat))
        task, work = map(table, p.flat), [Block(x) for x in local_work(p.flat, p.equations)]
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
            out[i] = problem.unit / RADIAN_LENGTH
        elif label.startswith("quaternion:"):
            out[i] = 2.0  # a unit quaternion turns by half the angle
    return out
