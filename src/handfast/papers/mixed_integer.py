"""A mixed-integer program with special ordered sets, and what a solver returns of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from handfast.core.arrays import Array, Indices

INF = float("inf")
Term = tuple[ArrayLike, ArrayLike]  # indices of variables, their coefficients
Solver = Literal["scip", "gurobi"]
SOLVERS: tuple[Solver, ...] = ("scip", "gurobi")


class SolverStatus(StrEnum):
    """How a solve of a mixed-integer program ended."""

    OPTIMAL = "optimal"
    INFEASIBLE = "infeasible"
    UNBOUNDED = "unbounded"
    TIME = "time"
    INTERRUPTED = "interrupted"
    FAILED = "failed"


@dataclass(frozen=True, eq=False)
class SolverResult:
    """What a solver returned: `x` is None without a point, `bound` is its proven bound on the objective."""

    status: SolverStatus
    x: Array | None
    bound: float
    nodes: int


@dataclass
class MixedIntegerProgram:
    """minimise cost . x subject to lo <= rows <= hi, lower <= x <= upper, and special ordered sets."""

    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    cost: dict[int, float] = field(default_factory=dict)
    rows: list[tuple[Indices, Array, float, float]] = field(default_factory=list)  # indices, values, lo, hi
    sos1: list[list[int]] = field(default_factory=list)
    sos2: list[list[int]] = field(default_factory=list)

    def variables(self, n: int, lower: float = -INF, upper: float = INF) -> Indices:
        """Indices (n,) of new variables."""
        start = len(self.lower)
        self.lower += [lower] * n
        self.upper += [upper] * n
        return np.arange(start, start + n)

    def row(self, terms: Sequence[Term], lo: float, hi: float) -> None:
        """Add lo <= sum of (indices, coefficients) <= hi; repeated indices add up."""
        index = np.concatenate([np.atleast_1d(i) for i, _ in terms]).astype(int)
        value = np.concatenate(
            [np.broadcast_to(np.asarray(v, dtype=float), np.shape(np.atleast_1d(i))) for i, v in terms]
        )
        total = np.bincount(index, weights=value, minlength=len(self.lower)).astype(np.float64)
        keep = np.flatnonzero(total)
        if len(keep):
            self.rows.append((keep, total[keep], lo, hi))
        elif lo > 0 or hi < 0:
            raise ValueError("a row without variables cannot be satisfied")

    def violation(self, x: Array) -> float:
        """The worst violation at x: rows relative to the size of their terms, sets by their smallest members."""
        worst = max(
            float(np.max(np.array(self.lower) - x, initial=0.0)),
            float(np.max(x - np.array(self.upper), initial=0.0)),
        )
        for index, value, lo, hi in self.rows:
            terms = value * x[index]
            scale = max(1.0, float(np.abs(terms).max()))
            total = float(terms.sum())
            worst = max(worst, (lo - total) / scale, (total - hi) / scale)
        for members in self.sos1:
            worst = max(worst, float(np.sort(np.abs(x[members]))[:-1].max(initial=0.0)))
        for members in self.sos2:
            v = np.abs(x[members])
            pairs = np.maximum(v[:-1], v[1:])
            first = int(np.argmax(v[:-1] + v[1:])) if len(pairs) else 0
            others = np.delete(v, [first, first + 1])
            worst = max(worst, float(others.max(initial=0.0)))
        return worst
