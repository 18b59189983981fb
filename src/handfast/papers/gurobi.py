"""Gurobi, the stability paper's own solver; its wheel's size-limited licence suffices for most grasps."""

from __future__ import annotations

import gurobipy
import numpy as np
from gurobipy import GRB

from handfast.core.errors import InputError
from handfast.papers.program import INF, MixedIntegerProgram
from handfast.stability.refinement import SolverResult, SolverStatus

FEASIBILITY = 1e-9
STATUS = {
    GRB.OPTIMAL: SolverStatus.OPTIMAL,
    GRB.INFEASIBLE: SolverStatus.INFEASIBLE,
    GRB.UNBOUNDED: SolverStatus.UNBOUNDED,
    GRB.TIME_LIMIT: SolverStatus.TIME,
    GRB.INTERRUPTED: SolverStatus.INTERRUPTED,
}


def solve(program: MixedIntegerProgram, time_limit: float) -> SolverResult:
    """Minimise the program; see `handfast.papers.mip.solve`.

    Raises:
        InputError: no licence, or one that is too small for the program.
    """
    try:
        with gurobipy.Env(params={"OutputFlag": 0}) as env, gurobipy.Model(env=env) as model:
            return _solve(model, program, time_limit)
    except gurobipy.GurobiError as error:
        if error.errno in (GRB.Error.NO_LICENSE, GRB.Error.SIZE_LIMIT_EXCEEDED):
            size = f"{len(program.lower)} variables, {len(program.rows)} rows"
            problem = f"gurobi's licence does not admit this program ({size}): take scip, or refine instead of --full"
            raise InputError(problem, field="solver") from None
        return SolverResult(SolverStatus.FAILED, None, -INF, 0)


def _solve(model: gurobipy.Model, program: MixedIntegerProgram, time_limit: float) -> SolverResult:
    model.Params.FeasibilityTol = FEASIBILITY
    model.Params.OptimalityTol = FEASIBILITY
    model.Params.IntFeasTol = FEASIBILITY
    model.Params.DualReductions = 0  # so that infeasible and unbounded are told apart
    model.Params.PreSOS1BigM = 0  # sets are branched on, never turned into big-M rows
    model.Params.PreSOS2BigM = 0
    if time_limit < INF:
        model.Params.TimeLimit = time_limit
    n = len(program.lower)
    cost = np.zeros(n)
    for i, v in program.cost.items():
        cost[i] = v
    lower, upper = np.array(program.lower), np.array(program.upper)
    xs = model.addMVar(n, lb=lower, ub=upper, obj=cost).tolist()
    for index, value, lo, hi in program.rows:
        total = gurobipy.LinExpr(value.tolist(), [xs[int(i)] for i in index])
        if lo == hi:
            model.addLConstr(total, GRB.EQUAL, lo)
            continue
        if lo > -INF:
            model.addLConstr(total, GRB.GREATER_EQUAL, lo)
        if hi < INF:
            model.addLConstr(total, GRB.LESS_EQUAL, hi)
    for kind, sets in ((GRB.SOS_TYPE1, program.sos1), (GRB.SOS_TYPE2, program.sos2)):
        for members in sets:
            model.addSOS(kind, [xs[int(i)] for i in members])
    model.optimize()
    status = STATUS.get(model.Status, SolverStatus.FAILED)
    x = np.array([xs[i].X for i in range(n)]) if model.SolCount else None
    bound = -INF
    if status in (SolverStatus.OPTIMAL, SolverStatus.TIME, SolverStatus.INTERRUPTED):
        bound = float(model.ObjBound)
        if abs(bound) >= 1e99:
            bound = -INF if bound < 0 else INF
    return SolverResult(status, x, bound, int(model.NodeCount))
