"""What multipliers prove about a linear program, whatever solver they come from, rounding included.

For rows lo <= A x <= hi, bounds l <= x <= u and any multipliers y,

    c x = y (A x) + (c - A^T y) x  >=  sum of min(y_i lo_i, y_i hi_i) + sum of min(d_j l_j, d_j u_j)

with d = c - A^T y (Neumaier and Shcherbina 2004). The right hand side is computed in floats and lowered by a
bound on the error. With c = 0 a positive one is a contradiction: there is no x (Farkas).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handfast.core.arrays import Array
from handfast.papers.polytopes import UNIT, LinearRows

TINY = 1e-290  # more than underflow can lose


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
