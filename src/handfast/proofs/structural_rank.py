"""An upper bound on a matrix's rank by where it may have entries, whatever these are.

A row is a whole number, with bit j where column j may have an entry.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import or_

import numpy as np

from handfast.proofs.fields import Mask


def as_bits(rows: Mask) -> list[int]:
    """Each row (K, n) as a whole number, bit j for column j."""
    return [int.from_bytes(row.tobytes(), "little") for row in np.packbits(rows, axis=1, bitorder="little")]


def fewer_rows(rows: Sequence[int], fewer: int) -> list[int]:
    """Rows that span the same, of rows whose rank is known to be below their number by so many."""
    return [reduce(or_, rows)] * (len(rows) - fewer) if fewer else list(rows)


def fewer_columns(rows: Sequence[int], joined: int, fewer: int) -> list[int]:
    """The matrix with fewer columns that span the same, where the rank of some is below their number by so many.

    joined: bit j where column j is one of them.
    """
    left = joined
    for _ in range(fewer):
        left &= left - 1  # without its lowest bit
    return [row & ~joined | left if row & joined else row for row in rows] if fewer else list(rows)


def fewest_lines(rows: Sequence[int]) -> int:
    """The least number of rows and columns that hold all entries of a matrix: no rank is higher.

    A maximum matching of rows and columns gives them (Koenig's theorem): the columns that are reached from a row
    without a partner, and the rows with entries in other columns. These hold all entries whatever the matching is, so
    that nothing rests on its being the largest.
    """
    partner: dict[int, int] = {}  # column: its row
    taken = full = seen = 0

    def placed(row: int) -> bool:
        nonlocal taken, seen
        free = row & ~taken & ~full
        if free:
            partner[free & -free] = row
            taken |= free & -free
            return True
        while rest := row & ~seen & ~full:
            column = rest & -rest
            seen |= column
            if placed(partner[column]):
                partner[column] = row
                return True
        return False

    for row in rows:
        seen = 0
        if not placed(row):
            full |= seen
    return full.bit_count() + sum(row & ~full > 0 for row in rows)
