"""Ranks by where entries are: small matrices by hand, and random ones against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import structural_rank

from handfast.proofs.structural_rank import as_bits, fewer_columns, fewer_rows, fewest_lines


def test_a_row_is_a_number_with_a_bit_for_each_column() -> None:
    rows = np.zeros((3, 70), dtype=bool)
    rows[0, [0, 3]], rows[2, [8, 69]] = True, True
    assert as_bits(rows) == [0b1001, 0, (1 << 8) | (1 << 69)]


@pytest.mark.parametrize(
    ("rows", "lines"),
    [
        ([], 0),
        ([0, 0], 0),
        ([0b111], 1),
        ([0b001, 0b001, 0b001], 1),  # one column
        ([0b001, 0b010, 0b100], 3),
        ([0b111, 0b001, 0b001], 2),  # the first row and the first column
        ([0b011, 0b011, 0b011], 2),  # three rows in two columns
        ([0b0011, 0b0011, 0b0011, 0b1100], 3),  # these, and one row beside them: neither rows nor columns are as few
        ([0b001, 0b011, 0b110], 3),  # the second and third give way
        ([0b110, 0b011, 0b001], 3),
        ([0b01, 0b01, 0b11, 0b10], 2),
    ],
)
def test_rows_and_columns_that_hold_all_entries(rows: list[int], lines: int) -> None:
    assert fewest_lines(rows) == lines
    assert fewest_lines(rows[::-1]) == lines


@pytest.mark.parametrize("seed", range(40))
def test_they_are_as_many_as_a_maximum_matching(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pattern = rng.random((rng.integers(1, 30), rng.integers(1, 30))) < rng.uniform(0.02, 0.3)
    assert fewest_lines(as_bits(pattern)) == structural_rank(csr_array(pattern))


def test_rows_of_a_lower_rank_become_fewer_that_touch_what_any_of_them_does() -> None:
    """(1, 1, 0), (0, 1, 1), (1, 2, 1): the third is the sum, two of any kind in all three columns span no less."""
    assert fewer_rows([0b011, 0b110, 0b111], 1) == [0b111, 0b111]
    assert fewer_rows([0b011, 0b100], 0) == [0b011, 0b100]
    assert fewer_rows([0b011, 0b110], 2) == []


def test_columns_of_a_lower_rank_become_fewer() -> None:
    """Columns 1 to 3 of rank 2: a row that touches one of them may touch any two that span them."""
    assert fewer_columns([0b00010, 0b00001, 0b11100], 0b01110, 1) == [0b01100, 0b00001, 0b11100]
    assert fewer_columns([0b00010, 0b10000], 0b01110, 3) == [0, 0b10000]
    assert fewer_columns([0b00010, 0b10000], 0b01110, 0) == [0b00010, 0b10000]
