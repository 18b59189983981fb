"""Linear programs about the canonical system over a box: their rows, HiGHS for multipliers, and what those prove.

Rows are Lambda and convex polytopes about the forms Psi (synthesis paper, 4.3, Fig. 5): x_k = x_i^2 lies in a
triangle, x_k = x_i x_j in a tetrahedron, a Bernstein patch in the convex hull of its control points over the sub-box.
Every row holds for every point of the form in the box in exact arithmetic: the slopes are floats whatever they are, and
the right hand sides are rounded outwards for those slopes.

Nothing that the solver says is taken without multipliers. For rows lo <= A x <= hi, bounds l <= x <= u and any y,

    c x = y (A x) + (c - A^T y) x  >=  sum of min(y_i lo_i, y_i hi_i) + sum of min(d_j l_j, d_j u_j)

with d = c - A^T y (Neumaier and Shcherbina 2004). The right hand side is computed in floats and lowered by a
bound on the error. With c = 0 a positive one is a contradiction: there is no x (Farkas).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.spatial import ConvexHull, QhullError

from handfast.core.arrays import Array, Indices
from handfast.core.errors import InputError
from handfast.core.libraries import silent
from handfast.model.bernstein import PADDING, restrict
from handfast.papers.canonical_system import Expanded, Patch
from handfast.proofs.intervals import UNDERFLOW_BOUND
from handfast.proofs.tolerance import UNIT_ROUNDOFF

INF = np.inf
MERGED = 9  # decimals to which two facets of a hull are one


# --- the rows ---


@dataclass(frozen=True, eq=False)
class LinearRows:
    """lo <= A x <= hi: A sparse (rows, n_x)."""

    A: sparse.csr_array
    lo: Array
    hi: Array


def polytopes(x: Expanded, lower: Array, upper: Array, slack: float) -> LinearRows:
    """Lambda, each equation to within `slack`, and the polytopes of all Psi over the box [lower, upper].

    The slack is for the rounding of the coefficients: the true mechanism fulfils the equations to within it.
    """
    n = len(x.b)
    parts = [_squares(x.squares, lower, upper), _products(x.products, lower, upper)]
    parts += [_patch(p, lower, upper) for p in x.patches]
    rows, columns, values, lo, hi = [], [], [], [x.b - slack], [x.b + slack]
    for c, v, low, high in parts:
        rows.append(np.repeat(np.arange(n, n + len(c)), c.shape[1]))
        columns.append(c.ravel())
        values.append(v.ravel())
        lo.append(low)
        hi.append(high)
        n += len(c)
    where = (np.concatenate(rows) - len(x.b), np.concatenate(columns))
    P = sparse.csr_array((np.concatenate(values), where), shape=(n - len(x.b), x.n))
    A = sparse.vstack([x.A, P], format="csr")
    A.eliminate_zeros()
    return LinearRows(A, np.concatenate(lo), np.concatenate(hi))


Part = tuple[Indices, Array, Array, Array]  # columns and slopes (rows, terms), lo and hi (rows,)


def _squares(where: Indices, lower: Array, upper: Array) -> Part:
    """The triangles: two tangents below, the chord above."""
    k, i = where.T
    l, u = lower[i], upper[i]
    one, none = np.ones(len(k)), np.full(len(k), INF)
    # x^2 - a x >= -(a/2)^2 for whatever a, and doubling is exact
    low = np.concatenate([_down(-l * l), _down(-u * u), -none])
    slope = l + u
    # x^2 - s x is convex, so that it is largest at an end
    chord = _up(np.maximum(_up(l * l) - _down(slope * l), _up(u * u) - _down(slope * u)))
    high = np.concatenate([none, none, chord])
    columns = np.tile(np.column_stack([k, i]), (3, 1))
    slopes = np.concatenate([np.column_stack([one, -s]) for s in (2 * l, 2 * u, slope)])
    return columns, slopes, low, high


def _products(where: Indices, lower: Array, upper: Array) -> Part:
    """The tetrahedra: (x_i - l_i)(x_j - l_j) >= 0 and the other three products of distances to the ends."""
    k, i, j = where.T
    li, ui, lj, uj = lower[i], upper[i], lower[j], upper[j]
    one, none = np.ones(len(k)), np.full(2 * len(k), INF)
    slopes = np.concatenate([np.column_stack([one, -b, -a]) for a, b in ((li, lj), (ui, uj), (li, uj), (ui, lj))])
    low = np.concatenate([_down(-(li * lj)), _down(-(ui * uj)), -none])
    high = np.concatenate([none, _up(-(li * uj)), _up(-(ui * lj))])
    return np.tile(np.column_stack([k, i, j]), (4, 1)), slopes, low, high


def _patch(p: Patch, lower: Array, upper: Array) -> Part:
    """The hull of the control points (33); of a flat one two planes of the same slope, which hold it as well."""
    ends = [(lower[p.i], upper[p.i]), (lower[p.j], upper[p.j])]
    b = restrict(p.points[:, :, None], *ends)[:, :, 0]
    s, t = (np.linspace(0.0, 1.0, n) for n in b.shape)
    s, t = (g.ravel() for g in np.meshgrid(s, t, indexing="ij"))
    (li, ui), (lj, uj) = ends
    # the form is that of the whole patch: the sub-patch's coefficients are off by rounding
    pad = PADDING * np.abs(p.points).max() + np.abs([li, ui, lj, uj]).max() * 8 * UNIT_ROUNDOFF
    C = np.column_stack([li + s * (ui - li), lj + t * (uj - lj), b.ravel()])
    normals = _facets(C)
    reach = np.abs(normals) @ np.abs(C).max(axis=0)
    high = _up((C @ normals.T).max(axis=0) + np.abs(normals).sum(axis=1) * pad + 8 * UNIT_ROUNDOFF * reach)
    columns = np.tile([p.i, p.j, p.k], (len(normals), 1))
    return columns, normals, np.full(len(normals), -INF), high


def _facets(C: Array) -> Array:
    """(facets, 3) outward normals of the hull of points (., 3), or of two planes about them if it is flat."""
    size = np.ptp(C, axis=0)
    scale = np.where(size > 0, size, 1.0)
    D = (C - C.min(axis=0)) / scale
    try:
        normals = ConvexHull(D).equations[:, :3]
    except QhullError:
        slope = np.linalg.lstsq(np.column_stack([D[:, :2], np.ones(len(D))]), D[:, 2], rcond=None)[0]
        normals = np.array([[-slope[0], -slope[1], 1.0], [slope[0], slope[1], -1.0]])
    normals = normals[np.unique(np.round(normals, MERGED), axis=0, return_index=True)[1]] / scale
    return normals / np.abs(normals).max(axis=1, keepdims=True)


def _up(a: Array) -> Array:
    return np.nextafter(a, INF)


def _down(a: Array) -> Array:
    return np.nextafter(a, -INF)


# --- programs and proofs ---


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
        self.gamma = 2 * deepest * UNIT_ROUNDOFF  # relative error of a column's sum, twice what is needed
        self.total = 2 * (sum(rows.A.shape) + 4) * UNIT_ROUNDOFF

    def below(self, y: Array, lower: Array, upper: Array, column: int | None = None, sign: float = 1.0) -> float:
        """No x of the program has sign x[column] (0 if None) below this; -inf if the multipliers are no good."""
        with np.errstate(all="ignore"):  # what overflows ends as NaN or infinity, which proves nothing
            bound = self._below(y, lower, upper, column, sign)
        return bound if np.isfinite(bound) else -np.inf

    def _below(self, y: Array, lower: Array, upper: Array, column: int | None, sign: float) -> float:
        rows = self.rows
        y = np.where(((y > 0) & np.isfinite(rows.lo)) | ((y < 0) & np.isfinite(rows.hi)), y, 0.0)
        d = -(self.AT @ y)
        error = self.gamma * (self.size @ np.abs(y)) + UNDERFLOW_BOUND
        if column is not None:
            d[column] += sign
            error[column] += 2 * UNIT_ROUNDOFF * (abs(d[column]) + 1)
        sides = y * np.where(y > 0, rows.lo, np.where(y < 0, rows.hi, 0.0))
        ends = np.where(d > 0, d * lower, d * upper)
        loss = error * np.maximum(np.abs(lower), np.abs(upper))
        bound = sides.sum() + ends.sum() - loss.sum()
        bound -= self.total * (np.abs(sides).sum() + np.abs(ends).sum() + loss.sum()) + UNDERFLOW_BOUND
        return float(bound)
