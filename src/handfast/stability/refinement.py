"""One step of Algorithm 1, as progress and answers tell of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from handfast.core.arrays import Array
from handfast.stability.scaled_problem import ScaledPoint


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


@dataclass(frozen=True, eq=False)
class RefinementStep:
    """One pass of Algorithm 1.

    Attributes:
        number: counts from 1.
        result: the solver's answer, checked against its program.
        point: the relaxation's solution in the model's (scaled) unknowns, None without one. Its scalar is lambda, s
            or the objective, whatever the goal.
        bound: what the solver proved about the objective of this relaxation, hence of the exact problem.
        width: [rad] the widest active sector, 0 if none is active; `finished` once all are at gamma / 2^q.
        edges: friction edges over all contacts.
        seconds: of this step.
    """

    number: int
    result: SolverResult
    point: ScaledPoint | None
    bound: float
    width: float
    finished: bool
    edges: int
    seconds: float
