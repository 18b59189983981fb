"""Algorithm 1 of the stability paper: solve a relaxation, refine the active sectors, repeat (section V).

An iterator: each step is one solved mixed-integer program; limits and early stops live outside.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from handfast.papers import mip
from handfast.papers.program import INF
from handfast.papers.relaxation import polygon, relaxation
from handfast.papers.sectors import Discretisation, Sector
from handfast.stability.goal import Goal
from handfast.stability.refinement import RefinementStep, SolverStatus
from handfast.stability.scaled_problem import ScaledProblem
from handfast.stability.settings import Solver


def run(
    p: ScaledProblem,
    goal: Goal,
    *,
    q: int = 9,
    solver: Solver = "scip",
    full: bool = False,
    printed_robustness: bool = False,
    time_limit: float = INF,
) -> Iterator[RefinementStep]:
    """Algorithm 1, one `RefinementStep` per mixed-integer program, until nothing is left to refine or none is feasible.

    Args:
        p: the scaled problem; with `p.mdp` False one program without sectors is solved.
        goal: the objective.
        q: finest level, sectors of gamma / 2^q; 4 * 2^q sectors in all (9: 2048).
        solver: "scip" or "gurobi".
        full: all sectors at the finest level from the start (the paper's comparison).
        printed_robustness: use (19) as printed, see `relaxation`.
        time_limit: [s] for all steps together.
    """
    deadline = time.monotonic() + time_limit
    begin = Discretisation.full if full else Discretisation.coarse
    sectors = [begin(q) for _ in p.mu]
    for number in range(1, 10_000):
        clock = time.monotonic()
        edges = [s.edges() for s in sectors] if p.mdp else [polygon() for _ in p.mu]
        model = relaxation(p, goal, edges, printed_robustness)
        result = mip.solve(model.program, solver, time_limit=deadline - clock)
        point = model.read(result.x) if result.x is not None else None
        to_refine: list[tuple[int, Sector]] = []
        width = 0.0
        if p.mdp and result.status is SolverStatus.OPTIMAL:
            for i, sector in enumerate(model.active(result.x)):
                if sector is not None:
                    width = max(width, 2 * np.pi * sector.width)
                    if not sectors[i].finest(sector):
                        to_refine.append((i, sector))
        yield RefinementStep(
            number=number,
            result=result,
            point=point,
            bound=result.bound,
            width=width,
            finished=result.status is SolverStatus.OPTIMAL and not to_refine,
            edges=sum(len(e.length) for e in edges),
            seconds=time.monotonic() - clock,
        )
        if result.status is not SolverStatus.OPTIMAL or not to_refine:
            return
        for i, sector in to_refine:
            sectors[i] = sectors[i].refined(sector)
