"""How a query is solved, and what it tells while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from handfast.core.errors import InputError
from handfast.core.parallel import default_jobs as default_jobs
from handfast.stability.refinement import RefinementStep

INF = float("inf")
Method = Literal["engine", "algorithm1"]
METHODS: tuple[Method, ...] = ("engine", "algorithm1")
Solver = Literal["scip", "gurobi"]
SOLVERS: tuple[Solver, ...] = ("scip", "gurobi")


@dataclass(frozen=True)
class Settings:
    """How a query is solved.

    Attributes:
        method: "engine", or "algorithm1", the paper's, which needs one of the solvers.
        gap: relative distance between witnessed and certified bound at which a maximum or an optimal
            torque is precise enough.
        time_limit: [s] for one query.
        node_limit: for one query of the engine.
        workers: threads of the engine for one question, 1 or 2; 0 takes two where there are two cores. They change
            nothing but the time.
        verify: of the engine: replay every proof with the independent checker before it is answered; what does not
            pass is searched again more finely. Many questions are quicker without, and their answers say so.
        solver: of Algorithm 1: "scip" or "gurobi".
        sectors: of Algorithm 1, finest friction discretisation: 4, 8, .. 2048 .. (4 * 2^q).
        full: of Algorithm 1: all sectors at the finest level at once, no refinement (the paper's comparison).
        as_printed: of Algorithm 1: refine to the finest level even when an exact solution already answers, and take
            (19) as printed.

    Raises:
        InputError: a number of sectors that is not 4 * 2^q, or limits that are not positive.
    """

    method: Method = "engine"
    gap: float = 1e-3
    time_limit: float = INF
    node_limit: float = INF
    workers: int = 0
    verify: bool = True
    solver: Solver = "scip"
    sectors: int = 2048
    full: bool = False
    as_printed: bool = False

    def __post_init__(self) -> None:
        q = np.log2(self.sectors / 4) if self.sectors >= 4 else -1.0
        if q < 0 or q != int(q) or q > 20:
            raise InputError(f"is {self.sectors}; 4, 8, 16, ... (4 times a power of two) is needed", field="sectors")
        if not self.gap > 0:
            raise InputError(f"is {self.gap:g}; a positive number is needed", field="gap")
        if not self.time_limit > 0:
            raise InputError(f"is {self.time_limit:g} s; a positive number is needed", field="time limit")
        if not self.node_limit > 0:
            raise InputError(f"is {self.node_limit:g}; a positive number is needed", field="node limit")
        if self.workers not in (0, 1, 2):
            raise InputError(f"is {self.workers}; 1 or 2 is possible, or 0 for as many as there are", field="workers")
        if self.method not in METHODS:
            raise InputError(f"is '{self.method}'; one of {', '.join(METHODS)} is needed", field="method")
        if self.solver not in SOLVERS:
            raise InputError(f"is '{self.solver}'; one of {', '.join(SOLVERS)} is needed", field="solver")

    @property
    def q(self) -> int:
        """Refinements from four sectors to the finest level."""
        return round(np.log2(self.sectors / 4))


@dataclass(frozen=True)
class Progress:
    """Where a query is: the bounds so far, nodes, and the last step of Algorithm 1 if that is the method."""

    lower: float
    upper: float
    nodes: int
    step: RefinementStep | None = None


OnStep = Callable[[Progress], None]
