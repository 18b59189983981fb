"""Linear programs on HiGHS, for their multipliers: nothing that it says is taken without them."""

from __future__ import annotations

from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.papers.polytopes import LinearRows


def highspy() -> Any:
    """The module; `InputError` naming the extra if it is not installed."""
    try:
        import highspy as module
    except ModuleNotFoundError:
        raise InputError("needs the package highspy: pip install 'handfast[reference]'", field="solver") from None
    return module


class LinearProgram:
    """min or max of one variable after the other over the same rows, each from the last one's basis.

    Args:
        rows: of the program.
        lower, upper: (n,) bounds; `bound` changes them.
        iterations, seconds: limits of every single program.
    """

    def __init__(self, rows: LinearRows, lower: Array, upper: Array, *, iterations: int, seconds: float) -> None:
        self._module = highspy()
        self._solver = H = self._module.Highs()
        for name, value in {
            "output_flag": False,
            "threads": 1,
            "presolve": "off",  # a ray is only given without
            "solver": "simplex",
            "simplex_strategy": 4,  # primal: the last program's solution is a start for the next one
            "simplex_scale_strategy": 4,  # twice as fast here as the default
            "simplex_iteration_limit": iterations,
        }.items():
            H.setOptionValue(name, value)
        self._seconds = seconds
        lp = self._module.HighsLp()
        lp.num_row_, lp.num_col_ = rows.A.shape
        lp.col_cost_ = np.zeros(lp.num_col_)
        lp.col_lower_, lp.col_upper_ = lower, upper
        lp.row_lower_, lp.row_upper_ = rows.lo, rows.hi
        lp.a_matrix_.format_ = self._module.MatrixFormat.kRowwise
        lp.a_matrix_.start_, lp.a_matrix_.index_ = rows.A.indptr, rows.A.indices
        lp.a_matrix_.value_ = rows.A.data
        H.passModel(lp)

    def bound(self, column: int, lower: float, upper: float) -> None:
        """New bounds of a variable."""
        self._solver.changeColBounds(column, lower, upper)

    def multipliers(self, column: int, sign: float) -> list[Array]:
        """Multipliers of the rows (rows,) worth trying for min sign * x[column]; of infeasibility, both signs."""
        H, status = self._solver, self._module.HighsModelStatus
        H.changeColCost(column, sign)
        H.setOptionValue("time_limit", H.getRunTime() + self._seconds)
        H.run()
        found = H.getModelStatus()
        out: list[Array] = []
        if found == status.kInfeasible:
            _, has_ray, ray = H.getDualRay()
            if has_ray:
                y = np.array(ray, dtype=float)
                out = [y, -y]
        elif H.getInfo().dual_solution_status == self._module.SolutionStatus.kSolutionStatusFeasible:
            out = [np.array(H.getSolution().row_dual, dtype=float)]
        H.changeColCost(column, 0.0)
        return out
