"""Linear programs on HiGHS for their multipliers, and what those prove, whatever solver they come from.

Nothing that the solver says is taken without them. For rows lo <= A x <= hi, bounds l <= x <= u and any multipliers y,

    c x = y (A x) + (c - A^T y) x  >=  sum of min(y_i lo_i, y_i hi_i) + sum of min(d_j l_j, d_j u_j)

with d = c - A^T y (Neumaier and Shcherbina 2004). The right hand side is computed in floats and lowered by a
bound on the error. With c = 0 a positive one is a contradiction: there is no x (Farkas).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.libraries import silent
from handfast.papers.polytopes import UNIT, LinearRows

TINY = 1e-290  # more than underflow can lose


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
        with silent(1):  # the first one greets on standard output
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


class DualBound:
    """The bounds that multipliers give for one set of rows; the box may change in between.

    Args:
        rows: the program's.
    """

    def __init__(self, rows: LinearRows) -> None:
        self.rows = rows
        self.AT = sparse.csr_array(rows.A.T)
        self.size = abs(self.AT)
        deepest = int(np.diff(self.AT.indptr).max(initial=0)) + 2
        self.gamma = 2 * deepest * UNIT  # relative error of a column's sum, twice what is needed
        self.total = 2 * (sum(rows.A.shape) + 4) * UNIT

    def below(self, y: Array, lower: Array, upper: Array, column: int | None = None, sign: float = 1.0) -> float:
        """No x of the program has sign x[column] (0 if None) below this; -inf if the multipliers are no good."""
        with np.errstate(all="ignore"):  # what overflows ends as NaN or infinity, which proves nothing
            bound = self._below(y, lower, upper, column, sign)
        return bound if np.isfinite(bound) else -np.inf

    def _below(self, y: Array, lower: Array, upper: Array, column: int | None, sign: float) -> float:
        rows = self.rows
        y = np.where(((y > 0) & np.isfinite(rows.lo)) | ((y < 0) & np.isfinite(rows.hi)), y, 0.0)
        d = -(self.AT @ y)
        error = self.gamma * (self.size @ np.abs(y)) + TINY
        if column is not None:
            d[column] += sign
            error[column] += 2 * UNIT * (abs(d[column]) + 1)
        sides = y * np.where(y > 0, rows.lo, np.where(y < 0, rows.hi, 0.0))
        ends = np.where(d > 0, d * lower, d * upper)
        loss = error * np.maximum(np.abs(lower), np.abs(upper))
        bound = sides.sum() + ends.sum() - loss.sum()
        bound -= self.total * (np.abs(sides).sum() + np.abs(ends).sum() + loss.sum()) + TINY
        return float(bound)
