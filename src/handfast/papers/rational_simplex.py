"""Small linear programs in rational arithmetic: the simplex method with Bland's rule, which always ends.

R. G. Bland, "New Finite Pivoting Rules for the Simplex Method", Mathematics of Operations Research 2(2), 1977.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flint import fmpq

ZERO, ONE = fmpq(0), fmpq(1)
Row = list[fmpq]


@dataclass
class RationalProgram:
    """The x >= 0 with A x = b, at a vertex; `feasible` says whether there is one.

    Made by `RationalProgram.of`; `maximise` goes on from the vertex where the last one ended.
    """

    table: list[Row]  # each with its right-hand side last, in terms of the basis
    basis: list[int]
    columns: int
    feasible: bool

    @classmethod
    def of(cls, A: Sequence[Sequence[fmpq]], b: Sequence[fmpq]) -> RationalProgram:
        """A: m rows of n numbers, b: m numbers."""
        n, m = len(A[0]), len(A)
        table = []
        for i, (row, right) in enumerate(zip(A, b, strict=True)):
            sign = -1 if right < 0 else 1
            table.append([sign * v for v in row] + [ONE if k == i else ZERO for k in range(m)] + [sign * right])
        self = cls(table, list(range(n, n + m)), n + m, False)
        if not self._improve([ZERO] * n + [-ONE] * m, n + m):
            raise AssertionError("a sum of numbers >= 0 has a least value")
        self.feasible = all(self.table[i][-1] == 0 for i, k in enumerate(self.basis) if k >= n)
        if self.feasible:
            self._drop_artificial(n)
        return self

    def maximise(self, cost: Sequence[fmpq]) -> bool:
        """Go to a vertex where cost . x is largest; False if it has no largest value."""
        return self._improve(list(cost), self.columns)

    @property
    def x(self) -> list[fmpq]:
        """The vertex."""
        out = [ZERO] * self.columns
        for row, k in zip(self.table, self.basis, strict=True):
            out[k] = row[-1]
        return out

    def _improve(self, cost: Row, columns: int) -> bool:
        gain = [*cost, ZERO]
        for row, k in zip(self.table, self.basis, strict=True):
            if cost[k] != 0:
                factor = cost[k]
                gain = [g - factor * v for g, v in zip(gain, row, strict=True)]
        while True:
            enter = next((k for k in range(columns) if gain[k] > 0), None)
            if enter is None:
                return True
            best: tuple[fmpq, int] | None = None
            leave = -1
            for i, row in enumerate(self.table):
                if row[enter] > 0:
                    at = row[-1] / row[enter], self.basis[i]
                    if best is None or at < best:
                        best, leave = at, i
            if best is None:
                return False
            self._pivot(leave, enter)
            factor, row = gain[enter], self.table[leave]
            gain = [g - factor * v for g, v in zip(gain, row, strict=True)]

    def _pivot(self, leave: int, enter: int) -> None:
        value = self.table[leave][enter]
        pivot = self.table[leave] = [v / value for v in self.table[leave]]
        for i, row in enumerate(self.table):
            if i != leave and row[enter] != 0:
                factor = row[enter]
                self.table[i] = [v - factor * p if p != 0 else v for v, p in zip(row, pivot, strict=True)]
        self.basis[leave] = enter

    def _drop_artificial(self, n: int) -> None:
        """Take the columns of the first phase away, and rows that say nothing."""
        for i in range(len(self.basis)):
            if self.basis[i] >= n:
                enter = next((k for k in range(n) if self.table[i][k] != 0), None)
                if enter is not None:
                    self._pivot(i, enter)
        kept = [i for i, k in enumerate(self.basis) if k < n]
        self.table = [self.table[i][:n] + self.table[i][-1:] for i in kept]
        self.basis = [self.basis[i] for i in kept]
        self.columns = n
