"""The proof of one leaf in rational arithmetic, where rounding does not show the ranks: the second way of `farkas`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from flint import fmpq, fmpq_mat, fmpz

from handfast.core.arrays import Array, Mask
from handfast.core.rational import rational, rational_cross, rounded
from handfast.stability.certify.certificate import Columns, Integers, Question
from handfast.stability.certify.leaf_rows import ContactMaps, LeafRows, equations
from handfast.stability.certify.leaf_systems import LEAST, LeafSystems
from handfast.stability.exact_sums import exact_contacts

RANK = 1e-9  # relative: what is smaller does not count for the rank, until shown exactly

Sparse = dict[int, fmpq]  # an unknown's number, its coefficient


@dataclass(frozen=True, eq=False)
class ExactRows:
    """The equalities E and the motions Z of `equations` over x, as rational numbers: one dictionary per row."""

    E: list[Sparse]
    Z: list[Sparse]
    n: int

    @classmethod
    def of(cls, question: Question) -> ExactRows:
        """From the positions, axes and contact frames as they are."""
        g, at = question.plain, Columns.of(question)
        E, _, Z = (
            [{int(j): rational(row[j]) for j in np.flatnonzero(row)} for row in np.atleast_2d(a)]
            for a in equations(question, ContactMaps.none(g))
        )
        for i, (p, frame, speeds) in enumerate(exact_contacts(g)):
            for k, direction in enumerate(frame, start=3 * i):
                for row, x in enumerate([*direction, *rational_cross(p, direction)]):
                    E[row][at.c.start + k] = Z[k][at.r.start + row] = x
            for j, speed in speeds.items():
                for k, direction in enumerate(frame, start=3 * i):
                    x = _sum(a * b for a, b in zip(direction, speed, strict=True))
                    E[6 + j][at.c.start + k], Z[k][at.q.start + j] = x, -x
            if i not in g.soft:
                continue
            s = int(np.searchsorted(g.soft, i))
            column, turning = at.twist.start + s, 3 * g.m + g.mechanism.a + s
            normal = [rational(g.levers[s]) * x for x in frame[0]]
            for row, x in enumerate(normal, start=3):
                E[row][column] = Z[turning][at.r.start + row] = x
            for j in speeds:
                if g.joints[j].type == "revolute":
                    x = _sum(rational(a) * b for a, b in zip(g.joints[j].axis, normal, strict=True))
                    E[6 + j][column], Z[turning][at.q.start + j] = x, -x
        return cls(E, Z, at.n)

    def margin(self, leaves: LeafSystems, k: int, rows: LeafRows) -> float:
        """y b + v h, relative, of multipliers that cancel exactly, near those of leaf k; -inf if none are found."""
        w, free = leaves.w[k], leaves.free[k]
        if not np.isfinite(leaves.B[k]).all() or not np.isfinite(w).all():
            return -np.inf
        used = leaves.used[k]
        equations_ = free & (leaves.index_of_all()[k] < 0) & (leaves.B[k] != 0).any(axis=1)
        for chosen in (used, used | equations_):
            out = self._solved(leaves, k, rows, np.flatnonzero(chosen))
            if out > 0:
                return out
        return -np.inf

    def _solved(self, leaves: LeafSystems, k: int, rows: LeafRows, used: Integers) -> float:
        """The same with these rows of the leaf's system only."""
        B, w, free = leaves.B[k][used], leaves.w[k][used], leaves.free[k][used]
        alive = np.flatnonzero((leaves.size[k][used] != 0).any(axis=0))
        exact = [self._row(rows, leaves.index_of_all()[k, j], int(j), leaves.B.shape[1]) for j in used]
        y = [rational(x) / rational(unit) for x, unit in zip(w, leaves.unit[k][used], strict=True)]
        if len(alive):
            # solve for the multipliers that may change most, by as many independent unknowns
            weight = np.where(free, 1.0, np.clip(np.sqrt(np.abs(w) / np.abs(w).max()), LEAST, 1.0))
            basis = _independent((B[:, alive] * weight[:, None]).T)
            others = [j for j in range(len(B)) if j not in basis]
            unknowns = alive[_independent(B[basis][:, alive])].tolist()
            rank = len(basis)
            if len(unknowns) < rank:
                return -np.inf
            zero = fmpq(0)
            matrix = fmpq_mat(rank, rank, [exact[j].get(i, zero) for i in unknowns for j in basis])
            right = [-_sum(y[j] * exact[j][i] for j in others if i in exact[j]) for i in unknowns]
            try:
                found = matrix.solve(fmpq_mat(rank, 1, right))
            except ZeroDivisionError:  # singular
                return -np.inf
            for place, j in enumerate(basis):
                y[j] = found[place, 0]
        if any(x < 0 for x, any_sign in zip(y, free, strict=True) if not any_sign):
            return -np.inf
        if not _cancels(y, exact, leaves.closed[k]):
            return -np.inf
        b = [rational(x) * rational(unit) for x, unit in zip(leaves.b[k][used], leaves.unit[k][used], strict=True)]
        terms = [x * right for x, right in zip(y, b, strict=True)]
        size = _sum(abs(x) for x in terms)

        def total_of(per_row: Array) -> fmpq:
            parts = zip(y, per_row[k][used], leaves.unit[k][used], strict=True)
            return _sum(abs(x) * rational(s) * rational(unit) for x, s, unit in parts)

        grows = total_of(leaves.growth)
        pushes = _sum(x for x, first in zip(y, leaves.first[k][used], strict=True) if first)
        end = float(leaves.end(np.array(bool(pushes >= grows)))) if grows != 0 else 0.0
        if size == 0 or not np.isfinite(end):
            return -np.inf
        return rounded((_sum(terms) - total_of(leaves.slack) - grows * rational(end)) / size)

    def _row(self, rows: LeafRows, number: int, place: int, K: int) -> Sparse:
        """A row of a leaf's system over x: of the certificate, or the equality at a place of K."""
        if number < 0:
            return self.E[place - (K - len(self.E))]
        value = rows.value[number]
        out = {int(i): rational(value[i]) for i in np.flatnonzero(value[: self.n])}
        for j in np.flatnonzero(value[self.n :]):
            factor = rational(value[self.n + j])
            for i, x in self.Z[j].items():
                out[i] = out.get(i, fmpq(0)) + factor * x
        return out


def _cancels(y: list[fmpq], rows: list[Sparse], closed: Mask) -> bool:
    """Do rows weighed by y add up to zero in every unknown that is closed?

    In whole numbers over common denominators: fractions are brought to their lowest terms after every sum.
    """
    common, shared = fmpz(1), fmpz(1)
    for x in y:
        common = common.lcm(x.q)
    for row in rows:
        for coefficient in row.values():
            shared = shared.lcm(coefficient.q)
    total: dict[int, fmpz] = {}
    for x, row in zip(y, rows, strict=True):
        weight = x.p * (common // x.q)
        for i, coefficient in row.items():
            if closed[i]:
                total[i] = total.get(i, fmpz(0)) + weight * (coefficient.p * (shared // coefficient.q))
    return all(x == 0 for x in total.values())


def _independent(A: Array) -> list[int]:
    """As many independent columns of A as there are, the largest first: Gram-Schmidt with pivoting."""
    A, chosen = A.copy(), []
    first = 0.0
    for _ in range(min(A.shape)):
        norms = np.sqrt((A * A).sum(axis=0))
        j = int(norms.argmax())
        first = first or norms[j]
        if not norms[j] > RANK * first:
            break
        chosen.append(j)
        along = A[:, j] / norms[j]
        for _again in range(2):  # once more for what rounding left
            A -= np.outer(along, along @ A)
        A[:, j] = 0.0
    return chosen


def _sum(terms: Iterable[fmpq]) -> fmpq:
    return sum(terms, fmpq(0))
