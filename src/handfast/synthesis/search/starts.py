"""Certified configurations from random starts: seeded blocks of starts, each one compiled call."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.core.groups import Block, table
from handfast.proofs.configurations import ContactPoint, Existence
from handfast.synthesis.search.library import LIBRARY
from handfast.synthesis.search.workspace import (
    ALIGNED,
    NUMBERS,
    PROVED,
    UNPROVED,
    USED,
    Draws,
    Found,
    found,
    interior,
    local_work,
)
from handfast.synthesis.task_problem import TaskProblem

BLOCK = 256  # starts that share one seed: the unit in which a search is resumed


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
        self.count = block * BLOCK
        self.unproved = 0
        self._interior, self._task = interior(problem.flat), tuple(map(table, problem.flat))
        self._work = tuple(map(Block, local_work(problem.flat, problem.equations)))
        self._block = Block(found(problem.n, problem.equations, BLOCK))
        self._kernel = LIBRARY.functions  # compiles where that has not been done yet

    @property
    def _width(self) -> int:
        return self.problem.n + 1 + ALIGNED * NUMBERS

    def run(self, many: int = BLOCK) -> list[Certified]:
        """The certified configurations of the next block, at most `many`; the rest of the block is left out."""
        numbers = np.random.default_rng([self.seed, self.block]).random((BLOCK, self._width))
        out: list[Certified] = []
        first = 0
        while first < BLOCK and len(out) < many:
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
