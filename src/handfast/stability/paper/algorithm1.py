"""Algorithm 1 of the stability paper: solve a relaxation, refine the active sectors, repeat (section V).

An iterator: each step is one solved mixed-integer program; limits and early stops live outside.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from handfast.stability.goal import Goal, Point
from handfast.stability.paper import mip
from handfast.stability.paper.program import INF, Solution, Status
from handfast.stability.paper.relaxation import polygon, relaxation
from handfast.stability.paper.sectors import Discretisation, Sector
from handfast.stability.problem import Problem


@dataclass(frozen=True, eq=False)
class Step:
    """One pass of Algorithm 1.

    Attributes:
        number: counts from 1.
        solution: the solver's answer, checked against its program.
        point: the relaxation's solution in the model's (scaled) unknowns, None without one. Its sigma
            is lambda, s or the objective, whatever the goal.
        bound: what the solver proved about the objective of this relaxation, hence of the exact problem.
        width: [rad] the widest active sector, 0 if none is active; `finished` once all are at gamma / 2^q.
        edges: friction edges over all contacts.
        seconds: of this step.
    """

    number: int
    solution: Solution
    point: Point | None
    bound: float
    width: float
    finished: bool
    edges: int
    seconds: float


def run(
    p: Problem,
    goal: Goal,
    *,
    q: int = 9,
    solver: mip.Solver = "scip",
    full: bool = False,
    printed_robustness: bool = False,
    time_limit: float = INF,
) -> Iterator[Step]:
    """Algorithm 1, one `Step` per mixed-integer program, until nothing is left to refine or none is feasible.

    Args:
        p: the scaled problem; with `p.mdp` False one program without sectors is solved.
        goal: the objective.
        q: finest level, sectors of gamma / 2^q; 4 * 2^q sectors in all (9: 2048).
        solver: "scip" or "gurobi".
        full: all sectors at the finest level from the start (the paper's comparison).
        printed_robustness: use (19) as printed, see `stability/relaxation`.
        time_limit: [s] for all steps together.
    """
    deadline = time.monotonic() + time_limit
    begin = Discretisation.full if full else Discretisation.coarse
    sectors = [begin(q) for _ in p.mu]
    for number in range(1, 10_000):
        clock = time.monotonic()
        edges = [s.edges() for s in sectors] if p.mdp else [polygon() for _ in p.mu]
        model = relaxation(p, goal, edges, printed_robustness)
        solution = mip.solve(model.program, solver, time_limit=deadline - clock)
        point = model.read(solution.x) if solution.x is not None else None
        to_refine: list[tuple[int, Sector]] = []
        width = 0.0
        if p.mdp and solution.status is Status.OPTIMAL:
            for i, sector in enumerate(model.active(solution.x)):
                if sector is not None:
                    width = max(width, 2 * np.pi * sector.width)
                    if not sectors[i].finest(sector):
                        to_refine.append((i, sector))
        yield Step(
            number=number,
            solution=solution,
            point=point,
            bound=solution.bound,
            width=width,
            finished=solution.status is Status.OPTIMAL and not to_refine,
            edges=sum(len(e.length) for e in edges),
            seconds=time.monotonic() - clock,
        )
        if solution.status is not Status.OPTIMAL or not to_refine:
            return
        for i, sector in to_refine:
            sectors[i] = sectors[i].refined(sector)
