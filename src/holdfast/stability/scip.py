"""SCIP: special ordered sets as native constraints."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from pyscipopt import Model, quicksum

from holdfast.stability.mip import INF, Program, Solution, Status

TOLERANCES = (1e-8, 1e-6)  # feasibility; the second only after a numerical failure with the first


@contextmanager
def _quiet() -> Iterator[None]:
    """SCIP's LP solver writes remarks on tolerances straight to file descriptor 2: let nobody read them."""
    sys.stderr.flush()
    saved = os.dup(2)
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(sink)


STATUS = {
    "optimal": Status.OPTIMAL,
    "infeasible": Status.INFEASIBLE,
    "unbounded": Status.UNBOUNDED,
    "timelimit": Status.TIME,
    "userinterrupt": Status.INTERRUPTED,
}


def solve(program: Program, time_limit: float) -> Solution:
    """Minimise the program; see `holdfast.stability.mip.solve`."""
    result = Solution(Status.FAILED, None, -INF, 0)
    for tolerance in TOLERANCES:
        try:
            result = _solve(program, time_limit, tolerance)
        except Exception as error:  # SCIP reports a failed LP as a bare Exception
            if type(error) is not Exception:
                raise
        if result.status is not Status.FAILED:
            break
    return result


def _solve(program: Program, time_limit: float, tolerance: float) -> Solution:
    model = Model()
    model.hideOutput()
    model.setParam("numerics/feastol", tolerance)
    model.setParam("numerics/dualfeastol", tolerance)
    if time_limit < INF:
        model.setParam("limits/time", time_limit)
    xs = [
        model.addVar(lb=None if lo == -INF else lo, ub=None if hi == INF else hi)
        for lo, hi in zip(program.lower, program.upper, strict=True)
    ]
    for index, value, lo, hi in program.rows:
        total = quicksum(v * xs[i] for i, v in zip(index, value, strict=True))
        if lo == hi:
            model.addCons(total == lo)
        elif hi == INF:
            model.addCons(total >= lo)
        elif lo == -INF:
            model.addCons(total <= hi)
        else:
            model.addCons(total >= lo)
            model.addCons(total <= hi)
    for members in program.sos1:
        model.addConsSOS1([xs[i] for i in members], list(range(1, len(members) + 1)))
    for members in program.sos2:
        model.addConsSOS2([xs[i] for i in members], list(range(1, len(members) + 1)))
    model.setObjective(quicksum(v * xs[i] for i, v in program.cost.items()), "minimize")
    with _quiet():
        model.optimize()

    name = model.getStatus()
    if name == "inforunbd":
        # presolving could not tell: without an objective there is nothing to be unbounded
        if program.cost:
            bare = Program(program.lower, program.upper, {}, program.rows, program.sos1, program.sos2)
            again = _solve(bare, time_limit, tolerance)
            status = Status.UNBOUNDED if again.status is Status.OPTIMAL else again.status
            return Solution(status, again.x, -INF, again.nodes)
        name = "infeasible"
    status = STATUS.get(name, Status.FAILED)
    x = None
    if model.getNSols() > 0:
        best = model.getBestSol()
        x = np.array([model.getSolVal(best, v) for v in xs])
    bound = model.getDualbound() if status is not Status.FAILED else -INF
    if abs(bound) >= model.infinity():
        bound = -INF if bound < 0 else INF
    return Solution(status, x, float(bound), int(model.getNTotalNodes()))
