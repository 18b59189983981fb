"""How a query is solved, and what it tells while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from holdfast.errors import InputError
from holdfast.stability.algorithm1 import Step
from holdfast.stability.mip import INF, SOLVERS, Solver


@dataclass(frozen=True)
class Settings:
    """Algorithm 1's settings.

    Attributes:
        solver: "scip" or "gurobi".
        sectors: finest friction discretisation: 4, 8, .. 2048 .. (4 * 2^q).
        gap: relative distance between witnessed and certified bound at which a maximum or an optimal
            torque is precise enough.
        time_limit: [s] for one query.
        full: all sectors at the finest level at once, no refinement (the paper's comparison).
        as_printed: refine to the finest level even when an exact solution already answers, and take
            (19) as printed.

    Raises:
        InputError: a number of sectors that is not 4 * 2^q, or limits that are not positive.
    """

    solver: Solver = "scip"
    sectors: int = 2048
    gap: float = 1e-3
    time_limit: float = INF
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
        if self.solver not in SOLVERS:
            raise InputError(f"is '{self.solver}'; one of {', '.join(SOLVERS)} is needed", field="solver")

    @property
    def q(self) -> int:
        """Refinements from four sectors to the finest level."""
        return round(np.log2(self.sectors / 4))


@dataclass(frozen=True)
class Progress:
    """Where a query is: after each step of Algorithm 1, with the bounds so far."""

    step: Step
    lower: float
    upper: float


OnStep = Callable[[Progress], None]
