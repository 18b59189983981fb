"""Mixed-integer programs with special ordered sets, solved by SCIP or Gurobi without any big-M.

Solvers are libraries; here is only the choice among them and the check of what they return.
"""

from __future__ import annotations

import importlib.util

from handfast.core.errors import InputError
from handfast.papers.program import INF, MixedIntegerProgram
from handfast.stability.refinement import SolverResult, SolverStatus
from handfast.stability.settings import SOLVERS, Solver

ACCEPTED = 1e-6  # a returned point that misses a constraint by more, relative to its row, is a failure


def available(solver: Solver) -> bool:
    """Is the solver's package installed?"""
    return importlib.util.find_spec({"scip": "pyscipopt", "gurobi": "gurobipy"}[solver]) is not None


def solve(program: MixedIntegerProgram, solver: Solver, *, time_limit: float = INF) -> SolverResult:
    """Solve and check: a point that violates the program turns the status into FAILED.

    Raises:
        InputError: unknown solver, or its package is not installed.
    """
    if solver not in SOLVERS:
        raise InputError(f"is '{solver}'; one of {', '.join(SOLVERS)} is needed", field="solver")
    if not available(solver):
        problem = f"'{solver}' is not installed; --method algorithm1 on it needs pip install 'handfast[reference]'"
        raise InputError(problem, field="solver")
    if time_limit <= 0:
        return SolverResult(SolverStatus.TIME, None, -INF, 0)
    if solver == "scip":
        from handfast.papers import scip as backend
    else:
        from handfast.papers import gurobi as backend  # type: ignore[no-redef]
    result = backend.solve(program, time_limit)
    if result.x is not None and program.violation(result.x) > ACCEPTED:
        return SolverResult(SolverStatus.FAILED, result.x, result.bound, result.nodes)
    return result
