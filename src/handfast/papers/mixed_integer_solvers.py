"""Mixed-integer programs on SCIP or Gurobi, without any big-M: the choice between them, the check of what they return.

Solvers are libraries of the extra `reference`. SCIP, which needs several attempts, has a file of its own.
"""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING

import numpy as np

from handfast.core.errors import InputError
from handfast.papers.mixed_integer import INF, SOLVERS, MixedIntegerProgram, Solver, SolverResult, SolverStatus

if TYPE_CHECKING:
    import gurobipy

ACCEPTED = 1e-6  # a returned point that misses a constraint by more, relative to its row, is a failure
GUROBI_FEASIBILITY = 1e-9


def available(solver: Solver) -> bool:
    """Is the solver's package installed?"""
    return importlib.util.find_spec({"scip": "pyscipopt", "gurobi": "gurobipy"}[solver]) is not None


def installed() -> Solver:
    """The first solver that is installed; `InputError` naming the extra if none is."""
    for solver in SOLVERS:
        if available(solver):
            return solver
    raise InputError("none is installed; Algorithm 1 needs pip install 'handfast[reference]'", field="solver")


def solve(program: MixedIntegerProgram, solver: Solver, *, timeout: float = INF) -> SolverResult:
    """Solve and check: a point that violates the program turns the status into FAILED.

    Raises:
        InputError: unknown solver, or its package is not installed.
    """
    if solver not in SOLVERS:
        raise InputError(f"is '{solver}'; one of {', '.join(SOLVERS)} is needed", field="solver")
    if not available(solver):
        problem = f"'{solver}' is not installed; Algorithm 1 on it needs pip install 'handfast[reference]'"
        raise InputError(problem, field="solver")
    if timeout <= 0:
        return SolverResult(SolverStatus.TIME, None, -INF, 0)
    if solver == "scip":
        from handfast.papers import scip

        result = scip.solve(program, timeout)
    else:
        result = _on_gurobi(program, timeout)
    if result.x is not None and program.violation(result.x) > ACCEPTED:
        return SolverResult(SolverStatus.FAILED, result.x, result.bound, result.nodes)
    return result


def _on_gurobi(program: MixedIntegerProgram, timeout: float) -> SolverResult:
    """By the stability paper's own solver; its wheel's size-limited licence suffices for most grasps.

    Raises:
        InputError: no licence, or one that is too small for the program.
    """
    import gurobipy
    from gurobipy import GRB

    try:
        with gurobipy.Env(params={"OutputFlag": 0}) as env, gurobipy.Model(env=env) as model:
            return _optimised(model, program, timeout)
    except gurobipy.GurobiError as error:
        if error.errno in (GRB.Error.NO_LICENSE, GRB.Error.SIZE_LIMIT_EXCEEDED):
            size = f"{len(program.lower)} variables, {len(program.rows)} rows"
            problem = f"gurobi's licence does not admit this program ({size}): take scip, or refine the sectors"
            raise InputError(problem, field="solver") from None
        return SolverResult(SolverStatus.FAILED, None, -INF, 0)


def _optimised(model: gurobipy.Model, program: MixedIntegerProgram, timeout: float) -> SolverResult:
    import gurobipy
    from gurobipy import GRB

    model.Params.FeasibilityTol = GUROBI_FEASIBILITY
    model.Params.OptimalityTol = GUROBI_FEASIBILITY
    model.Params.IntFeasTol = GUROBI_FEASIBILITY
    model.Params.DualReductions = 0  # so that infeasible and unbounded are told apart
    model.Params.PreSOS1BigM = 0  # sets are branched on, never turned into big-M rows
    model.Params.PreSOS2BigM = 0
    if timeout < INF:
        model.Params.TimeLimit = timeout
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
    ended = {
        GRB.OPTIMAL: SolverStatus.OPTIMAL,
        GRB.INFEASIBLE: SolverStatus.INFEASIBLE,
        GRB.UNBOUNDED: SolverStatus.UNBOUNDED,
        GRB.TIME_LIMIT: SolverStatus.TIME,
        GRB.INTERRUPTED: SolverStatus.INTERRUPTED,
    }
    status = ended.get(model.Status, SolverStatus.FAILED)
    x = np.array([xs[i].X for i in range(n)]) if model.SolCount else None
    bound = -INF
    if status in (SolverStatus.OPTIMAL, SolverStatus.TIME, SolverStatus.INTERRUPTED):
        bound = float(model.ObjBound)
        if abs(bound) >= 1e99:
            bound = -INF if bound < 0 else INF
    return SolverResult(status, x, bound, int(model.NodeCount))
